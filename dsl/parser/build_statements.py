"""Nodes of items and of the statements of models from the rules of `sd.lark`; see `build_expressions`."""

from __future__ import annotations

from typing import Any

from sysdyn.dsl.parser.build_expressions import Values
from sysdyn.dsl.parser.notes import Notes
from sysdyn.dsl.text.source import Span
from sysdyn.dsl.tree import syntax as s

_ENERGIES = ("T*", "T", "V*", "V")


def start(v: Values, span: Span, notes: Notes) -> tuple[s.TopLevel, ...]:
    """`_body{item}`."""
    return tuple(v)


def block(v: Values, span: Span, notes: Notes) -> tuple[s.Statement, ...]:
    """`{ _body{statement} }`."""
    return tuple(v)


actions = block
guards = block
parameters = block
rows = block
connections = block
trace_items = block


# --- items ---


def import_(v: Values, span: Span, notes: Notes) -> s.Import:
    """`from dotted import words`."""
    return s.Import(v[0], v[1], span, notes.doc(span))


def domain(v: Values, span: Span, notes: Notes) -> s.DomainDefinition:
    """`domain NAME { _body{role} }`."""
    notes.check_declared(v[0])
    return s.DomainDefinition(v[0], tuple(v[1:]), span, notes.doc(span))


def role(v: Values, span: Span, notes: Notes) -> s.DomainRole:
    """`ROLE NAME : unit`."""
    return s.DomainRole(v[0], v[1], v[2], span)


def domain_node(v: Values, span: Span, notes: Notes) -> s.DomainNode | s.BrokenStatement:
    """`node common ROLE`."""
    if v[0] not in ("effort", "flow"):
        notes.error("E113", f"nodes have a common effort or a common flow, not a common {v[0]}", span)
        return s.BrokenStatement(frozenset(), span)
    return s.DomainNode(v[0], span)


def domain_ground(v: Values, span: Span, notes: Notes) -> s.DomainGround:
    """`ground STRING`."""
    return s.DomainGround(v[0].value, span)


def domain_pseudo(v: Values, span: Span, notes: Notes) -> s.DomainPseudo:
    """`pseudo : unit`."""
    return s.DomainPseudo(v[0], span)


def bundle(v: Values, span: Span, notes: Notes) -> s.BundleDefinition:
    """`bundle NAME { _body{bundle_member} }`."""
    notes.check_declared(v[0])
    return s.BundleDefinition(v[0], tuple(v[1:]), span, notes.doc(span))


def bundle_member(v: Values, span: Span, notes: Notes) -> s.BundleMember:
    """`words : domain_name`."""
    return s.BundleMember(v[0], v[1], span)


def unit_alias(v: Values, span: Span, notes: Notes) -> s.UnitAlias:
    """`unit NAME = expr`."""
    return s.UnitAlias(v[0], v[1], span, notes.doc(span))


def unit_base(v: Values, span: Span, notes: Notes) -> s.UnitBase:
    """`unit NAME base`."""
    return s.UnitBase(v[0], span, notes.doc(span))


def const(v: Values, span: Span, notes: Notes) -> s.ConstDefinition:
    """`const NAME = expr`."""
    notes.check_declared(v[0])
    return s.ConstDefinition(v[0], v[1], span, notes.doc(span))


def function(v: Values, span: Span, notes: Notes) -> s.FunctionDefinition:
    """`fn NAME ( [parameters] ) -> unit = expr`."""
    notes.check_declared(v[0])
    return s.FunctionDefinition(v[0], v[1] or (), v[2], v[3], span, notes.doc(span))


def parameter(v: Values, span: Span, notes: Notes) -> s.FormalParameter:
    """`NAME [[ expr ]] : unit`."""
    return s.FormalParameter(v[0].name, v[1], v[2], span)


def table(v: Values, span: Span, notes: Notes) -> s.TableDefinition:
    """`table NAME ( parameters ) -> unit INTERPOLATION [EXTRAPOLATION] rows`."""
    notes.check_declared(v[0])
    return s.TableDefinition(v[0], v[1], v[2], v[3], v[4], v[5], None, span, notes.doc(span))


def table_file(v: Values, span: Span, notes: Notes) -> s.TableDefinition:
    """`table NAME ( parameters ) -> unit INTERPOLATION [EXTRAPOLATION] file STRING`."""
    notes.check_declared(v[0])
    return s.TableDefinition(v[0], v[1], v[2], v[3], v[4], None, v[5].value, span, notes.doc(span))


def row(v: Values, span: Span, notes: Notes) -> s.TableRow:
    """`( _signed (, _signed)+ )`."""
    return s.TableRow(tuple(v), span)


def component(v: Values, span: Span, notes: Notes) -> s.ComponentDefinition:
    """`component NAME block`."""
    notes.check_declared(v[0])
    return s.ComponentDefinition(v[0], v[1], span, notes.doc(span))


def model(v: Values, span: Span, notes: Notes) -> s.ModelDefinition:
    """`model NAME block`."""
    notes.check_declared(v[0])
    return s.ModelDefinition(v[0], v[1], span, notes.doc(span))


def scene(v: Values, span: Span, notes: Notes) -> s.SceneDefinition:
    """`scene NAME of dotted { _body{scene_statement} }`."""
    return s.SceneDefinition(v[0], v[1], tuple(v[2:]), span, notes.doc(span))


# --- statements of components and models ---


def param(v: Values, span: Span, notes: Notes) -> s.ParamStatement:
    """`param decl [: unit] [= expr]`."""
    notes.check_declared(v[0])
    return s.ParamStatement(v[0], v[1], v[2], span, notes.doc(span))


def node(v: Values, span: Span, notes: Notes) -> s.NodeStatement:
    """`node decls : domain_name [initial]`."""
    notes.check_declared(*v[0])
    return s.NodeStatement(v[0], v[1], v[2], span, notes.doc(span))


def port(v: Values, span: Span, notes: Notes) -> s.PortStatement:
    """`port decls : domain_name`."""
    notes.check_declared(*v[0])
    return s.PortStatement(v[0], v[1], span, notes.doc(span))


def branch(v: Values, span: Span, notes: Notes) -> s.BranchStatement:
    """`branch [decls] : domain_name`."""
    notes.check_declared(*(v[0] or ()))
    return s.BranchStatement(v[0] or (), v[1], span, notes.doc(span))


def input_(v: Values, span: Span, notes: Notes) -> s.InputStatement:
    """`input decl : unit [= expr]`."""
    notes.check_declared(v[0])
    return s.InputStatement(v[0], v[1], v[2], span, notes.doc(span))


def output(v: Values, span: Span, notes: Notes) -> s.OutputStatement:
    """`output decl = expr`."""
    notes.check_declared(v[0])
    return s.OutputStatement(v[0], v[1], span, notes.doc(span))


def quasi(v: Values, span: Span, notes: Notes) -> s.QuasiStatement:
    """`quasi decl : unit = expr`."""
    notes.check_declared(v[0])
    return s.QuasiStatement(v[0], v[1], v[2], span, notes.doc(span))


def coord(v: Values, span: Span, notes: Notes) -> s.CoordStatement:
    """`COORD decls : domain_name [TANGIBLE] [initial]`."""
    notes.check_declared(*v[1])
    tangible = None if v[3] is None else v[3] == "tangible"
    return s.CoordStatement(v[0], v[1], v[2], tangible, v[4], span, notes.doc(span))


def implicit(v: Values, span: Span, notes: Notes) -> s.ImplicitStatement:
    """`implicit decls : unit [initial]`."""
    notes.check_declared(*v[0])
    return s.ImplicitStatement(v[0], v[1], v[2], span, notes.doc(span))


def state(v: Values, span: Span, notes: Notes) -> s.StateStatement:
    """`state decl [: unit] [= expr]`."""
    notes.check_declared(v[0])
    return s.StateStatement(v[0], v[1], v[2], span, notes.doc(span))


def discrete(v: Values, span: Span, notes: Notes) -> s.DiscreteStatement:
    """`discrete decl [: unit] = expr`."""
    notes.check_declared(v[0])
    return s.DiscreteStatement(v[0], v[1], v[2], span, notes.doc(span))


def dynamic(v: Values, span: Span, notes: Notes) -> s.DynamicStatement:
    """`dynamic ref = expr`."""
    return s.DynamicStatement(v[0], v[1], span, notes.doc(span))


def let(v: Values, span: Span, notes: Notes) -> s.LetStatement:
    """`let decl = expr`."""
    notes.check_declared(v[0])
    return s.LetStatement(v[0], v[1], span, notes.doc(span))


def law(v: Values, span: Span, notes: Notes) -> s.LawStatement:
    """`law arith = expr`."""
    return s.LawStatement(v[0], v[1], span, notes.doc(span))


def energy(v: Values, span: Span, notes: Notes) -> s.EnergyStatement | s.ContentStatement:
    """`energy STATE_FUNCTION [NAME] = expr`."""
    return _state_function(v, span, notes, "energy")


def content(v: Values, span: Span, notes: Notes) -> s.EnergyStatement | s.ContentStatement:
    """`content STATE_FUNCTION [NAME] = expr`."""
    return _state_function(v, span, notes, "content")


def _state_function(v: Values, span: Span, notes: Notes, written: str) -> s.EnergyStatement | s.ContentStatement:
    """An energy or a content by its letter, whatever word was written (E308 where they differ)."""
    letter, name, value = v
    right = "energy" if letter.name in _ENERGIES else "content"
    if right != written:
        what = "an energy (J)" if right == "energy" else "a content (W)"
        all_ = "T*, T, V, V* are energies, D and G contents"
        notes.error("E308", f"{letter.name} is {what}; {all_}", letter.span, f"{right} {letter.name} = ...")
    if right == "energy":
        return s.EnergyStatement(letter.name, name, value, span, notes.doc(span))
    return s.ContentStatement(letter.name, name, value, span, notes.doc(span))


def work(v: Values, span: Span, notes: Notes) -> s.WorkStatement:
    """`work arith on arith`."""
    return s.WorkStatement(v[0], v[1], span, notes.doc(span))


def constraint(v: Values, span: Span, notes: Notes) -> s.ConstraintStatement:
    """`CONSTRAINT decl : arith relation arith guards`."""
    notes.check_declared(v[1])
    return s.ConstraintStatement(v[0], v[1], v[2], v[3], v[4], v[5], span, notes.doc(span))


def relation(v: Values, span: Span, notes: Notes) -> Any:
    """`= | >= | <=`."""
    return v[0]


def comparison(v: Values, span: Span, notes: Notes) -> Any:
    """`== | != | <= | >= | < | >`."""
    return v[0]


def guard_while(v: Values, span: Span, notes: Notes) -> s.Guard:
    """`while expr`."""
    return s.Guard("while", v[0], span)


def guard_restitution(v: Values, span: Span, notes: Notes) -> s.Guard:
    """`restitution arith`."""
    return s.Guard("restitution", v[0], span)


def init(v: Values, span: Span, notes: Notes) -> s.InitStatement:
    """`init ref initial`."""
    return s.InitStatement(v[0], v[1], span, notes.doc(span))


def when(v: Values, span: Span, notes: Notes) -> s.WhenStatement:
    """`when expr actions`."""
    return s.WhenStatement(v[0], v[1], span, notes.doc(span))


def every(v: Values, span: Span, notes: Notes) -> s.EveryStatement:
    """`every arith actions`."""
    return s.EveryStatement(v[0], v[1], span, notes.doc(span))


def action(v: Values, span: Span, notes: Notes) -> s.ActionStatement:
    """`ref := expr`."""
    return s.ActionStatement(v[0], v[1], span)


def for_(v: Values, span: Span, notes: Notes) -> s.ForStatement:
    """`for NAME in range block`."""
    notes.check_declared(v[0])
    return s.ForStatement(v[0], v[1].lower, v[1].upper, v[2], span, notes.doc(span))


def level(v: Values, span: Span, notes: Notes) -> s.LevelStatement:
    """`level NAME [extends NAME] [DEFAULT] block`."""
    return s.LevelStatement(v[0], v[1], v[2] is not None, v[3], span, notes.doc(span))


def require(v: Values, span: Span, notes: Notes) -> s.RequireStatement:
    """`require expr`."""
    return s.RequireStatement(v[0], span, notes.doc(span))


def expect(v: Values, span: Span, notes: Notes) -> s.ExpectStatement:
    """`expect [moment] arith COMPARE arith [within arith]`."""
    moment, at = v[0] or (None, None)
    return s.ExpectStatement(moment, at, v[1], v[2], v[3], v[4], span, notes.doc(span))


def moment(v: Values, span: Span, notes: Notes) -> tuple[str, None]:
    """`MOMENT :`."""
    return v[0], None


def moment_at(v: Values, span: Span, notes: Notes) -> tuple[str, s.Expr]:
    """`at arith :`."""
    return "at", v[0]


def golden(v: Values, span: Span, notes: Notes) -> s.GoldenStatement:
    """`expect golden STRING within arith`."""
    return s.GoldenStatement(v[0].value, v[1], span, notes.doc(span))


def lossless(v: Values, span: Span, notes: Notes) -> s.LosslessStatement:
    """`lossless`."""
    return s.LosslessStatement(span, notes.doc(span))


def instance(v: Values, span: Span, notes: Notes) -> s.InstanceStatement:
    """`decl : dotted [args] [connections]`."""
    if v[0].name != "t":
        # the library has elements 't': a label is only read with a dot behind it, time never is
        notes.check_declared(v[0])
    return s.InstanceStatement(v[0], v[1], v[2], v[3] or (), span, notes.doc(span))


def across(v: Values, span: Span, notes: Notes) -> s.Across:
    """`ref -> ref`."""
    return s.Across(v[0], v[1], span)


def on(v: Values, span: Span, notes: Notes) -> s.On:
    """`on arith`."""
    return s.On(v[0], span)


def bind(v: Values, span: Span, notes: Notes) -> s.Bind:
    """`NAME = expr`."""
    return s.Bind(v[0], v[1], span)


def bind_on(v: Values, span: Span, notes: Notes) -> s.Bind:
    """`on = expr`: an input of that name."""
    return s.Bind(s.Word("on", Span(span.start, span.start + len("on"))), v[0], span)


def bind_across(v: Values, span: Span, notes: Notes) -> s.BindAcross:
    """`NAME = ref -> ref`."""
    return s.BindAcross(v[0], v[1], v[2], span)


def single(v: Values, span: Span, notes: Notes) -> s.Single:
    """`ref`."""
    return s.Single(v[0], span)
