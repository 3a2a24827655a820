"""What is said of an index that is none of the form i + c."""

from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.affine import AFFINE, EACH, not_affine


def test_a_size_of_one_element_is_named_and_a_product_is_not():
    with ex.fresh():
        k = ex.index("k")
        text, help_, size = not_affine(ex.add(ex.param("S.N", k), ex.const(-1.0)), "")
        assert (size, help_) == ("S.N", EACH)
        assert text.startswith("S.N[k] is a size")
        text, help_, size = not_affine(ex.mul(k, k), ": i + c")
        assert (size, help_) == (None, AFFINE)
        assert text == "index k^2 is not affine: i + c"
        assert not_affine(ex.param("#table", k), "")[2] is None  # the compiler's own
