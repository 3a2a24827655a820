"""`sysdyn simulate`: its options, and the trace that comes of them."""

import os
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
from sysdyn import api
from sysdyn.cli.main import run
from sysdyn.runtime.integrate import creeping
from sysdyn.runtime.trace.trace import Trace
from texts import ARRAY, BROKEN, ENDLESS, PENDULUM, process, run_json, write


def simulate(tmp_path, text, *options, exit_code=0):
    """The trace of a text under options."""
    path = write(tmp_path, text)
    assert run(["simulate", "-q", path, "-o", "out.h5", *options]) == exit_code
    return Trace.open("out.h5")


@pytest.mark.long
def test_default_names_of_traces(tmp_path):
    (tmp_path / "folder").mkdir()
    path = write(tmp_path / "folder", PENDULUM, "a.b.sd")
    assert run(["simulate", "-q", path]) == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.b-swing.h5", "folder"]


@pytest.mark.long
def test_the_trace_is_as_the_contract_says(tmp_path):
    simulate(tmp_path, PENDULUM)
    with h5py.File("out.h5") as file:
        assert file["time"].is_scale
        assert file["time"].dtype == np.float64
        for name, unit in (
            ("x", "m"),
            ("y", "mm"),
            ("speed", "m/s"),
            ("audit/energy", "J"),
            ("audit/constraints", "1"),
        ):
            data = file[name]
            assert data.attrs["units"] == unit.encode() or data.attrs["units"] == unit
            assert data.attrs["long_name"]
            assert data.dims[0].keys() == ["time"]
            assert data.shape == file["time"].shape
        assert file["x"].attrs["nominal"] == pytest.approx(np.max(np.abs(file["x"])), rel=1e-6)
        assert file[file["x"].attrs["derivative"]].shape == file["time"].shape
        wanted = {
            "Conventions",
            "title",
            "source",
            "model",
            "scene",
            "formulation",
            "method",
            "index",
            "start_strategy",
            "rtol",
            "atol",
            "model_sha256",
            "statistics",
            "timings",
            "final",
            "met",
            "judged",
        }
        assert set(file.attrs) == wanted | {"conserved"}  # its energy: nothing dissipates or supplies
        assert file.attrs["final"] == 1
        assert dict(file["parameters"].items()).keys() == {"m", "l"}
        assert file["parameters/l"][()] == 2.34

        def no_objects(_, item):
            if isinstance(item, h5py.Dataset):
                assert item.dtype.kind in "fiuS"

        file.visititems(no_objects)


@pytest.mark.long
def test_two_runs_without_timings_are_equal_bit_for_bit(tmp_path):
    path = write(tmp_path, PENDULUM)

    def content(name):
        found = {}
        with h5py.File(name) as file:

            def visit(place, item):
                if isinstance(item, h5py.Dataset):
                    found[place] = item[()].tobytes()
                for key, value in item.attrs.items():
                    if key not in ("DIMENSION_LIST", "REFERENCE_LIST"):
                        found[place, key] = np.asarray(value).tobytes()

            visit("/", file)
            file.visititems(visit)
        return found

    for name in ("a.h5", "b.h5"):
        assert process("simulate", "-q", path, "--no-timings", "-o", name).returncode == 0
    one, other = content("a.h5"), content("b.h5")
    assert one == other
    assert ("/", "timings") not in one


@pytest.mark.long
def test_xarray_opens_the_trace(tmp_path):
    xarray = pytest.importorskip("xarray")
    simulate(tmp_path, PENDULUM)
    with xarray.open_dataset("out.h5", engine="h5netcdf") as data:
        assert data["x"].dims == ("time",)
        assert "time" in data.coords
        assert data["time"].size == 101
        assert data["y"].attrs["units"] == "mm"
        assert data["y"].attrs["long_name"]
        assert float(data["x"].sel(time=0.0)) == 1.0


def parameters(trace):
    """Values by name."""
    return {name: value for name, (value, _) in trace.parameters.items()}


@pytest.mark.parametrize(
    ("setting", "name", "value"),
    [
        ("l=1.5", "l", 1.5),
        ("l = 1500 mm", "l", 1.5),
        ("l=3 m/2", "l", 1.5),
        ("l=hypot(0.9, 1.2)*1 m", "l", 1.5),
        ("m=2e-1", "m", 0.2),
        ("m=200 g", "m", 0.2),
    ],
)
@pytest.mark.long
def test_set_a_parameter(tmp_path, setting, name, value):
    trace = simulate(tmp_path, PENDULUM, "--set", setting)
    assert parameters(trace)[name] == pytest.approx(value, rel=1e-15)


def test_set_elements_sizes_and_inputs(tmp_path):
    trace = simulate(tmp_path, ARRAY, "--set", "m[2]=3", "--set", "k=8 N/m")
    assert parameters(trace) == {"n": 3.0, "m[1]": 1.0, "m[2]": 3.0, "m[3]": 1.0, "k": 8.0, "push": 0.0}
    np.testing.assert_allclose(trace["last"].values[-1], 0.03 * np.cos(np.sqrt(8.0)), atol=3e-6)
    trace = simulate(tmp_path, ARRAY, "--set", "n=5")
    assert trace["last"].values[0] == pytest.approx(0.05)
    trace = simulate(tmp_path, ARRAY, "--set", "push=0.5 N")
    omega = np.sqrt(2.0)
    assert trace["x[1]"].values[-1] == pytest.approx(0.25 + (0.01 - 0.25) * np.cos(omega), rel=1e-4)


@pytest.mark.parametrize(
    ("setting", "code", "said"),
    [
        ("L=2", "E910", "L"),
        ("l=2 kg", None, "kg"),
        ("l=2 parsnip", None, "parsnip"),
        ("l=(", None, ""),
        ("l=l0", "E101", "l0"),
        ("m[1]=2", None, ""),
        ("l=2\nsecond", None, ""),
        ("l}=2", None, ""),
        ("l=2; m=3", None, ""),
    ],
)
@pytest.mark.one_in(5)
def test_settings_that_make_no_sense(tmp_path, capsys, setting, code, said):
    exit_code, found = run_json(capsys, "simulate", write(tmp_path, PENDULUM), "--set", setting)
    assert exit_code == 2
    errors = [d for d in found["diagnostics"] if d["severity"] == "error"]
    assert errors
    assert code is None or errors[0]["code"] == code
    assert any(said in f"{d['message']} {d['help']}" for d in errors)
    assert not Path("model-swing.h5").exists()


def test_the_nearest_name_is_offered(tmp_path, capsys):
    code, found = run_json(capsys, "simulate", write(tmp_path, ARRAY), "--set", "psh=1 N")
    assert code == 2
    assert "push" in found["diagnostics"][0]["help"]


@pytest.mark.long
def test_until_and_at(tmp_path):
    trace = simulate(tmp_path, PENDULUM, "--until", "500 ms", "--at", "0.1234,1 s/3,min(0.2, 0.3)*1 s")
    assert trace.time[-1] == 0.5
    for t in (0.1234, 1.0 / 3.0, 0.2):
        assert np.min(np.abs(trace.time - t)) < 1e-15
    assert simulate(tmp_path, PENDULUM, "--until", "0.25").time[-1] == 0.25


@pytest.mark.parametrize("instants", ["0.1,,0.2", ",", "0.1,", ""])
@pytest.mark.one_in(2)
def test_an_instant_that_is_missing_is_wrong_usage(tmp_path, instants, capsys):
    assert run(["simulate", write(tmp_path, PENDULUM), "--at", instants]) == 2
    assert f"--at '{instants}': a value is missing" in capsys.readouterr().err


@pytest.mark.parametrize("option", [("--until", "1 m"), ("--until", "x"), ("--at", "1 kg"), ("--max-wall", "2 V")])
@pytest.mark.one_in(2)
def test_times_with_other_units_are_refused(tmp_path, capsys, option):
    assert run(["simulate", write(tmp_path, PENDULUM), *option]) == 2
    assert option[0] in capsys.readouterr().err


def test_formulation_index_and_tolerances_are_in_the_trace(tmp_path):
    trace = simulate(tmp_path, PENDULUM, "--formulation", "hamiltonian", "--rtol", "1e-5", "--atol", "1e-9")
    assert trace.attributes["formulation"] == "hamiltonian"
    assert (trace.attributes["rtol"], trace.attributes["atol"]) == (1e-5, 1e-9)
    assert trace.attributes["model_sha256"] != simulate(tmp_path, ARRAY).attributes["model_sha256"]
    assert simulate(tmp_path, PENDULUM, "--index", "3").attributes["index"] == "3"


@pytest.mark.long
def test_backends_agree(tmp_path):
    c = simulate(tmp_path, PENDULUM)
    numpy = simulate(tmp_path, PENDULUM, "--backend", "numpy")
    np.testing.assert_allclose(c["x"].values, numpy["x"].values, atol=2e-4)


@pytest.mark.parametrize("expect", ["", "expect always: abs(audit.energy) <= 1 J"])
@pytest.mark.long
def test_a_draft_left_alone_tells_its_balance_only_where_it_is_asked_for(expect, tmp_path, capsys):
    """Integrals of powers are for the run that is kept, and for what reads them."""
    scene = f"scene alone of pendulum {{\n time 0 s to 6 s\n trace x every 10 ms\n {expect}\n}}\n"
    gallery = Path(__file__).parents[2] / "models/gallery/pendulum.sd"
    path = write(tmp_path, gallery.read_text().split("scene", 1)[0] + scene)
    assert run(["simulate", path, "--max-steps", "17", "-o", "out.h5"]) == 3
    said = capsys.readouterr()
    assert "that of a coarser run to the end" in said.err
    assert ("energy balance" in said.out + said.err) is bool(expect)
    assert "nan" not in said.out + said.err


def test_a_claim_on_the_error_of_a_run_asks_for_accuracy(tmp_path, capsys):
    path = write(tmp_path, PENDULUM.replace("<= 1 J", "<= 1 uJ"))
    assert run(["simulate", path, "--method", "bdf", "-o", "out.h5"]) == 1
    assert "help: audit.energy measures the error of the run: a smaller --accuracy" in capsys.readouterr().err
    assert run(["simulate", path, "--method", "bdf", "--accuracy", "1e-9", "-o", "out.h5"]) == 0


def test_limits_leave_a_readable_trace(tmp_path, capsys):
    path = write(tmp_path, PENDULUM)
    assert run(["simulate", path, "--max-steps", "5", "-o", "out.h5"]) == 3
    assert "the limit of steps is reached" in capsys.readouterr().err
    trace = Trace.open("out.h5")
    assert not trace.final
    assert trace.statistics["steps"] == 5
    assert run(["simulate", write(tmp_path, ENDLESS), "--max-wall", "300 ms", "-o", "out.h5"]) == 3
    assert "the limit of wall time is reached" in capsys.readouterr().err
    assert not Trace.open("out.h5").final


@pytest.mark.long
def test_errors_leave_the_old_trace_alone(tmp_path):
    simulate(tmp_path, PENDULUM)
    before = Path("out.h5").read_bytes()
    assert run(["simulate", "-q", write(tmp_path, BROKEN), "-o", "out.h5"]) == 1
    assert Path("out.h5").read_bytes() == before


@pytest.mark.long
def test_changing_parameters_compiles_nothing(tmp_path, monkeypatch):
    cache = tmp_path / "cache"
    monkeypatch.setenv("SYSDYN_CACHE", str(cache))
    simulate(tmp_path, ARRAY)
    before = sorted(cache.iterdir())
    assert len(before) == 1
    for setting in ("k=5 N/m", "m[1]=2 kg", "n=7", "push=1 N"):
        simulate(tmp_path, ARRAY, "--set", setting)
    assert sorted(cache.iterdir()) == before


@pytest.mark.parametrize("compiler", ["/nonexistent/cc", "false"])
@pytest.mark.long
def test_numpy_takes_over_without_a_compiler(tmp_path, capsys, monkeypatch, compiler):
    monkeypatch.setenv("SYSDYN_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("CC", compiler)
    assert run(["simulate", write(tmp_path, PENDULUM)]) == 0
    err = capsys.readouterr().err
    assert "note N609" in err
    assert "the NumPy backend takes over" in err
    assert ", numpy\n" in err


@pytest.mark.long
def test_an_empty_path_has_no_compiler(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("SYSDYN_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    assert run(["simulate", write(tmp_path, PENDULUM)]) == 0
    assert "note N609" in capsys.readouterr().err


@pytest.mark.long
def test_to_standard_output(tmp_path):
    path = write(tmp_path, PENDULUM)
    ran = process("simulate", path, "-o", "-", text=False)
    assert ran.returncode == 0
    assert ran.stdout.startswith(b"\x89HDF")
    assert b"swing of pendulum" in ran.stderr
    drawn = process("plot", "-", "-o", "-", text=False, input=ran.stdout)
    assert drawn.stdout.startswith(b"\x89PNG")
    assert not list(tmp_path.glob("*.h5"))


@pytest.mark.long
def test_progress_on_request(tmp_path):
    path = write(tmp_path, ENDLESS)
    ran = process("simulate", path, "--max-wall", "2.5", "--progress", "always")
    assert ran.returncode == 3
    assert " %" in ran.stderr
    assert " %" not in process("simulate", path, "--max-wall", "1.5").stderr


@pytest.mark.long
def test_what_the_start_moved_is_said(tmp_path, capsys):
    assert run(["simulate", write(tmp_path, PENDULUM)]) == 0
    assert "y: -2.1 -> -2.11556, asked for by phi rod" in capsys.readouterr().err


@pytest.mark.long
def test_what_the_start_moved_is_said_by_the_names_of_the_text(tmp_path, capsys):
    """A node's effort, not the multiplier that stands for it; the element whose law alone says what it is."""
    model = Path(__file__).parents[2] / "models" / "gallery" / "heat_exchanger.sd"
    options = "--set", "n=3", "--set", "C=1 J/K", "-o", str(tmp_path / "x.h5")
    assert run_json(capsys, "simulate", str(model), *options)[1]["result"]["moved"] == [
        "h[0].e: 293.15 -> 363.15, asked for by inlet_h",
        "c[4].e: 293.15 -> 288.15, asked for by inlet_c",
    ]


@pytest.mark.long
def test_the_balance_of_energy_is_finite_within_steps_that_time_does_not_resolve(tmp_path, capsys):
    """Where the valve turns, steps share their instant; a balance by those before was infinite there."""
    text = (Path(__file__).parents[2] / "models" / "gallery" / "fluid_tank.sd").read_text()
    claim = "scene fill of fluid_tank {\n  expect always: abs(audit.energy) <= 10 J"
    path = write(tmp_path, text.replace("scene fill of fluid_tank {", claim))
    assert run(["simulate", path, "--scene", "fill", "-o", str(tmp_path / "out.h5")]) == 0, capsys.readouterr().err


@pytest.mark.long
def test_what_cannot_be_is_said_with_a_code(tmp_path, capsys):
    path = write(tmp_path, PENDULUM)
    assert run(["simulate", path, "--level", "a=b"]) == 2
    assert "E802" in capsys.readouterr().err
    assert run(["simulate", path, "--method", "dopri", "--index", "2"]) == 1
    assert "E607" in capsys.readouterr().err


@pytest.mark.long
def test_the_span_is_told_where_a_run_does_not_begin_at_zero(tmp_path, capsys):
    text = PENDULUM.replace("time 0 s to", "time 0.25 s to")
    assert text != PENDULUM
    assert run(["simulate", write(tmp_path, text)]) == 0
    assert "  0.25 s to 1 s in " in capsys.readouterr().err


def test_an_end_out_of_reach_is_said(tmp_path, monkeypatch, capsys):
    """A swing of a second can be followed for 1e12 s by nobody: not a matter of the resolution of time."""
    for kind in ("RUN", "DRAFT"):
        monkeypatch.setattr(creeping, kind, ((400, 1e-6),))
    path = write(tmp_path, PENDULUM.replace(" every 10 ms", ""))
    assert run(["simulate", "-q", path, "--until", "1e12"]) == 3
    err = capsys.readouterr().err
    assert "at such steps the end of the run is out of reach" in err
    assert "help: an earlier end (--until)" in err


@pytest.mark.long
def test_bare_numbers_of_an_array_are_in_si_units(tmp_path):
    """x[i] swings with sqrt(k/m[i]): cos of it at the end, from i cm."""
    trace = simulate(tmp_path, ARRAY, "--set", "m=[1, 2, 3]", "--accuracy", "1e-8")
    at = trace.time[-1]
    assert trace["x[1]"][-1] == pytest.approx(0.01 * np.cos(np.sqrt(2.0) * at), abs=1e-9)
    assert trace["last"][-1] == pytest.approx(0.03 * np.cos(np.sqrt(2.0 / 3.0) * at), abs=1e-9)


def test_steps_of_euler(tmp_path, capsys):
    """x' = v, m v' = -k x by the implicit Euler: |x + i v/w| shrinks by sqrt(1 + (w h)^2) a step."""
    path = write(tmp_path, "model m { coord x: translation = 1 m\ninit x' = 0 m/s\nenergy T* = 1/2*(1 kg)*x'^2\n"
                           "energy V = 1/2*(4 N/m)*x^2 }\nscene s of m { time 0 s to 1 s; trace x, x' }")  # fmt: skip
    for h, said in ((1e-3, 1e-3), (1e-2, "10 ms")):
        trace = api.simulate(path, method="euler", step=said, output=tmp_path / "t.h5")
        size = np.hypot(trace["x"].values[-1], trace["x'"].values[-1] / 2.0)
        assert abs(size - (1.0 + (2.0 * h) ** 2) ** (-0.5 / h)) < 1e-6
    for options in (["--method", "euler"], ["--step", "1"], ["--method", "euler", "--step", "0"]):
        assert run(["simulate", path, *options, "-o", str(tmp_path / "t.h5")]) == 2
        assert "--step" in capsys.readouterr().err


def test_a_limit_of_wall_time_that_is_over_before_the_run(tmp_path, capsys):
    path = write(tmp_path, "model m { state x: 1 = 1\ndynamic x' = -x/(1 s) }\nscene s of m { time 0 s to 1 s }")
    assert run(["simulate", path, "--max-wall", "1 ns", "-o", str(tmp_path / "t.h5")]) == 3
    assert "E934" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "remedy"),
    [
        ([], "a looser --accuracy"),
        (["--rtol", "1e-6"], "a looser --rtol"),
        (["--method", "euler", "--step", "1e-3"], "a longer --step"),
    ],
)
@pytest.mark.long
def test_what_would_shorten_a_stopped_run_is_what_it_listens_to(tmp_path, capsys, monkeypatch, options, remedy):
    monkeypatch.chdir(tmp_path)
    code, found = run_json(capsys, "simulate", write(tmp_path, PENDULUM), "--max-steps", "5", *options)
    assert code == 3
    (said,) = [d for d in found["diagnostics"] if d["severity"] == "error"]
    assert said["code"] == "E934"
    assert said["help"].startswith(f"a higher limit, or {remedy}")


def test_a_device_and_a_pipe_take_a_trace(tmp_path, capsys):
    path = write(tmp_path, PENDULUM)
    assert run(["simulate", path, "-o", os.devnull]) == 0
    assert capsys.readouterr().err.rstrip().endswith(os.devnull)
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with subprocess.Popen(["cat", pipe], stdout=subprocess.PIPE) as reader:
        assert run(["simulate", path, "-o", str(pipe), "--quiet"]) == 0
        assert reader.stdout.read().startswith(b"\x89HDF")
    if Path("/dev/full").exists():
        assert run(["simulate", path, "-o", "/dev/full"]) == 5
        assert "/dev/full: No space left on device" in capsys.readouterr().err
    assert not list(tmp_path.glob("*.h5"))
