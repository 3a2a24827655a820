"""Which model and scene of a file a command means."""

from __future__ import annotations

import glob
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from sysdyn.cli.failures import UsageError, instead
from sysdyn.dsl import load
from sysdyn.dsl.load import ParsedFile
from sysdyn.dsl.text.decoding import decode
from sysdyn.dsl.text.diagnostics import Diagnostic, Report, SourceText
from sysdyn.dsl.tree import syntax
from sysdyn.values import dataclass

if TYPE_CHECKING:
    from sysdyn.cli.run.request.run_request import RunRequest


@dataclass(frozen=True, slots=True)
class Target:
    """A model under a scene, or by itself."""

    document: ParsedFile
    model: syntax.ModelDefinition
    scene: syntax.SceneDefinition | None

    @property
    def name(self) -> str:
        """For messages: 'swing of pendulum'."""
        model = self.model.name.name
        return f"{self.scene.name.name} of {model}" if self.scene else model


def read(path: str, report: Report, text: str | None = None) -> ParsedFile:
    """Parse a file, or standard input where path is '-'; text: what stood there, if it was read before."""
    if path == "-":
        source = decode("<stdin>", sys.stdin.buffer) if text is None else SourceText("<stdin>", text)
        return load.document(source, report)
    return load.read(path, report)


def files(given: Iterable[str]) -> list[str]:
    """The model files that arguments name: of a folder all below it, of a pattern those that fit; each once.

    UsageError where a folder or a pattern has none.
    """
    found: dict[str, None] = {}
    for name in given:
        path = Path(name)
        # all models below a folder, hidden ones left out
        if name != "-" and path.is_dir():
            inside = [p for p in sorted(path.rglob("*.sd")) if not _hidden(p.relative_to(path))]
            if not inside:
                raise UsageError(f"there is no .sd file in the folder {name}")
            found |= dict.fromkeys(map(str, inside))
        # a pattern that the shell did not expand
        elif any(sign in name for sign in "*?[") and not path.exists():
            fitting = sorted(glob.glob(name, recursive=True))  # noqa: PTH207 (a pattern may be absolute)
            if not fitting:
                raise UsageError(f"no file fits the pattern {name}")
            found |= dict.fromkeys(fitting)
        else:
            found[name] = None
    return list(found)


def _hidden(path: Path) -> bool:
    """Whether a name on the way begins with a dot."""
    return any(part.startswith(".") for part in path.parts)


def all_targets(document: ParsedFile, report: Report) -> list[Target]:
    """Every scene, and every model without one."""
    found = []
    for scene in document.scenes.values():
        model = load.model_of(document, scene, report)
        if model is not None:
            found.append(Target(document, model, scene))
    used = {t.model.name.name for t in found}
    return found + [Target(document, m, None) for n, m in document.models.items() if n not in used]


def one(document: ParsedFile, path: str, model: str | None, scene: str | None, report: Report) -> Target | None:
    """The target that the options name, or the only one there is; None where its text has errors.

    UsageError with the list where there are several and none is named.
    """
    # the scene tells the model
    if scene is not None:
        found = document.scenes.get(scene)
        if found is None:
            raise _nothing(document, path, "scene", scene, list(document.scenes), report)
        owner = load.model_of(document, found, report)
        if owner is None:
            return None
        if model is not None and owner.name.name != model:
            raise UsageError(f"scene '{scene}' is of model '{owner.name.name}', not of '{model}'")
        return Target(document, owner, found)
    if model is not None and model not in document.models:
        raise _nothing(document, path, "model", model, list(document.models), report)
    # the only scene, of the model that is named
    scenes = [s for s in document.scenes.values() if model is None or s.model.names == (model,)]
    if len(scenes) == 1:
        return one(document, path, model, scenes[0].name.name, report)
    # several: the author says which
    if scenes:
        raise UsageError(f"{path} has several scenes: --scene {' | '.join(s.name.name for s in scenes)}")
    return whole(document, path, model, None, report)


def target_of(request: RunRequest, report: Report, choose: Callable[..., Target | None] = one) -> Target | None:
    """What a request means of its file, by `one`, `still` or `whole`."""
    document = read(request.file, report, request.text)
    return choose(document, request.file, request.model, request.scene, report)


def with_text(request: RunRequest, target: Target) -> RunRequest:
    """The request for other processes: what stood on standard input is read once."""
    return replace(request, text=target.document.file.source.text if request.file == "-" else None)


def still(document: ParsedFile, path: str, model: str | None, scene: str | None, report: Report) -> Target | None:
    """As `one`, of what needs no scene to run: where there are several and none is named it is the model by itself."""
    several = [s for s in document.scenes.values() if model is None or s.model.names == (model,)]
    return (whole if len(several) > 1 else one)(document, path, model, scene, report)


def whole(document: ParsedFile, path: str, model: str | None, scene: str | None, report: Report) -> Target | None:
    """The scene that is named, else a model by itself: the one named, or the only one there is.

    None where its text has errors; UsageError with the list where there are several models and none is named.
    """
    # with its scene
    if scene is not None:
        return one(document, path, model, scene, report)
    if model is not None and model not in document.models:
        raise _nothing(document, path, "model", model, list(document.models), report)
    # the only model
    names = [model] if model is not None else list(document.models)
    if len(names) == 1:
        return Target(document, document.models[names[0]], None)
    if names:
        raise UsageError(f"{path} has several models: --model {' | '.join(names)}")
    if report.failed:
        return None
    raise UsageError(f"{path} has no model")


def refuse_unsupported(found: Iterable[Diagnostic]) -> Iterator[Diagnostic]:
    """The findings where a run is asked of a text that cannot be run yet: what N608 notes is then the error E608."""
    help_ = "leave it out of what is run; 'check' passes texts that are ahead of the compiler"
    return (replace(d, code="E608", help=d.help or help_) if d.code == "N608" else d for d in found)


def _nothing(document: ParsedFile, path: str, what: str, name: str, names: list[str], report: Report) -> Exception:
    if report.failed and not names:
        from sysdyn.dsl.text.diagnostics import ModelError

        return ModelError(report.diagnostics)
    code = "E901" if what == "scene" else "E902"
    return UsageError(f"{code}: {path} has no {what} '{name}'; {instead(name, names)}")
