"""What is said of an index that is none of the form i + c."""

from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.affine import AFFINE, EACH, index_text, not_affine


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


def test_loop_variables_have_the_names_of_the_text():
    """Not those by which the compiler tells them apart."""
    with ex.fresh():
        inner, outer = ex.index("i_2"), ex.index("#1")
        assert index_text(ex.mul(inner, inner)) == "i^2"
        assert index_text(ex.param("pick", ex.index("#0"))) == "pick[i]"
        assert index_text(ex.add(outer, ex.const(1.0))) == "j + 1"
        assert not_affine(ex.mul(inner, inner), "", "i*i")[0] == "index i*i is not affine"
