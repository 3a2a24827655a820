"""Pages read as a browser would: their elements, what they would load, what they would run."""

from html.parser import HTMLParser

VOID = {"meta", "link", "br", "img", "input", "hr"}
LOADING = {"src", "srcset", "data", "action", "formaction", "poster", "background", "ping"}


class Page(HTMLParser):
    """tags: how many of each; open: elements that were not closed; outside: what refers to anywhere else."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.tags, self.open, self.outside, self.ids, self.scripts, self.links = {}, [], [], [], [], []
        self.text = []
        self.feed(text)
        self.close()
        assert not self.open, self.open

    def handle_starttag(self, tag, attributes):
        self.tags[tag] = self.tags.get(tag, 0) + 1
        if tag not in VOID:
            self.open.append(tag)
        if tag == "script":
            self.scripts.append(dict(attributes).get("type"))
        for name, value in attributes:
            if name == "id":
                self.ids.append(value)
            if name == "href" and value.startswith("#"):
                self.links.append(value[1:])
            elif name in ("href", "xlink:href"):
                self.outside.append((tag, name, value))
            if name in LOADING or name.startswith("on") or "url(" in (value or ""):
                self.outside.append((tag, name, value))

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag, tag

    def handle_data(self, data):
        self.text.append(data)

    @property
    def words(self):
        return "".join(self.text)


def read(path):
    """The page of a file, self-contained: it loads nothing, its links and ids fit."""
    text = path.read_text(encoding="utf-8")
    page = Page(text)
    assert page.outside == []
    assert len(page.ids) == len(set(page.ids))
    assert set(page.links) <= set(page.ids), set(page.links) - set(page.ids)
    assert "default-src 'none'" in text
    assert "@import" not in text
    return page
