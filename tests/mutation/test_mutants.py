"""The mutation tool: it changes what it says, one thing at a time, and tells a caught mutant from one that is not."""

import importlib.util
import random
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

ROOT = Path(__file__).resolve().parents[2]
_spec = importlib.util.spec_from_file_location("mutants_tool", Path(__file__).with_name("mutants.py"))
tool = importlib.util.module_from_spec(_spec)
SOURCE = '''
@numbered(3, "kinetic energy", (1,))
def energy(x: Shape[2]) -> float:
    """A docstring with 3 - 2."""
    return -x**2 + 0.5 if x[0, 4:] > 1e-9 else 0


@proves(3)
def _():
    return 1 - 1
'''


@pytest.fixture(scope="module", autouse=True)
def _load():
    sys.modules["mutants_tool"] = tool  # a dataclass looks its module up
    _spec.loader.exec_module(tool)


@pytest.fixture
def package(monkeypatch):
    """The tests as a package, which pytest itself does not make of them."""
    monkeypatch.syspath_prepend(ROOT)


def test_operators_and_constants_change_one_at_a_time():
    found = {mutant.after for mutant in tool.mutants(SOURCE)}
    kept = "if x[0, 4:] > 1e-09 else 0"
    assert found == {
        f"return -x ** 2 - 0.5 {kept}",
        f"return x ** 2 + 0.5 {kept}",
        f"return -x ** 3 + 0.5 {kept}",
        f"return -x ** 1 + 0.5 {kept}",
        f"return -x ** 2 + 0.55 {kept}",
        f"return -x ** 2 + 0.45 {kept}",
        "return -x ** 2 + 0.5 if x[1, 4:] > 1e-09 else 0",
        "return -x ** 2 + 0.5 if x[0, 5:] > 1e-09 else 0",
        "return -x ** 2 + 0.5 if x[0, 3:] > 1e-09 else 0",
        "return -x ** 2 + 0.5 if x[0, 4:] > 1e-09 else 1",
        "return -x ** 2 + 0.5 if x[0, 4:] > 1e-09 else -1",
        "return -x ** 2 + 0.5 if x[0, 4:] <= 1e-09 else 0",
    }
    assert {mutant.function for mutant in tool.mutants(SOURCE)} == {"energy"}


@pytest.mark.parametrize(
    ("statement", "changed"),
    [
        ("y = a * b", {"y = a / b"}),
        ("y = a and b", {"y = a or b"}),
        ("y = not a", {"y = a"}),
        ("y = a in b", {"y = a not in b"}),
        ("y = a is b", {"y = a is not b"}),
        ("y = a == b", {"y = a != b"}),
        ("y = a < b", {"y = a >= b"}),
        ("y = a < len(b)", {"y = a >= len(b)", "y = a <= len(b)"}),
        ("y = a.size >= b", {"y = a.size < b", "y = a.size > b"}),
        ("f(a, b)", {"pass", "f(b, a)"}),
        ("y = f(a, a, *b)", set()),
        ("y[a] = b", {"pass"}),
        ("y += b", {"y -= b", "pass"}),
        ("raise ValueError(1 - a)", {"pass"}),
        ("for y in a: break", {"pass"}),
        ("match a:\n case 0: y = b", {"case 1", "case -1"}),
    ],
)
def test_what_else_changes(statement, changed):
    assert {mutant.after for mutant in tool.mutants(statement)} == changed


def test_mutants_of_a_module_differ_and_compile():
    for name in ("solvers/rayleigh", "paper/driven"):
        source = (ROOT / "cra_sym" / f"{name}.py").read_text(encoding="utf-8")
        found = tool.mutants(source)
        assert len(found) > 30
        for mutant in random.Random(1).sample(found, 30):
            compile(mutant.source, name, "exec")
            assert mutant.before != mutant.after


def test_a_record_is_continued_and_keeps_reasons_and_closed_holes(tmp_path, package):
    from tests.mutation.record import Record
    from tests.mutation.runner import Verdict

    def record(source=SOURCE, **options):
        return Record(tmp_path, "room/name", source, tool.mutants(source), 1, **options)

    one, two, three = (run := record()).drawn(3)
    run.add(one, Verdict.SURVIVED)
    run.add(two, Verdict.CAUGHT)
    run.add(three, Verdict.SURVIVED)
    file = tmp_path / "room" / "name.json"
    file.write_text(file.read_text().replace('"reason": ""', '"reason": "because"', 1))
    continued = record("# Only words.\n" + SOURCE.replace("3 - 2", "other words"))
    assert [m.change for m in continued.unexplained()] == [three.change]
    assert one.change not in [m.change for m in continued.drawn(None)] and len(continued.drawn(5)) == 2
    continued.close(continued.unexplained()[0], Verdict.CAUGHT, "a test")
    assert not record().unexplained()
    order = record(again=True).drawn(None)
    sites = len({m.path for m in order})
    assert len({m.path for m in order[:sites]}) == sites < len(order) == len(tool.mutants(SOURCE))
    for anew in (record(again=True), record(SOURCE + "x = 0.5")):
        assert len(anew.drawn(3)) == 3
        anew.add(two, Verdict.CAUGHT)
        anew.add(one, Verdict.SURVIVED)
        assert not anew.unexplained()
    record(again=True).add(two, Verdict.CAUGHT)
    continued = record()
    continued.add(one, Verdict.SURVIVED)
    assert not continued.unexplained()


def test_every_test_that_watches_is_there(package):
    from tests.mutation import watch

    assert set(watch._ROUNDS) <= set(watch.watched_modules())
    for module in watch.watched_modules():
        for name in (name for part in watch.rounds(module) for name in part):
            file, _, test = name.partition("::")
            assert (ROOT / file).exists(), f"{module}: {file}"
            assert not test or f"def {test}(" in (ROOT / file).read_text(encoding="utf-8"), f"{module}: {name}"
    waves = [f"tests/solvers/test_{name}.py" for name in ("waves", "waves_lanes", "waves_modes")]
    assert watch.rounds("solvers/waves_kernel")[0] == waves  # no file of its name
    assert watch.rounds("solvers/straight")[0] == ["tests/solvers/test_straight.py"]


@pytest.mark.parametrize(("broken", "noticed"), [(True, "test_some.py"), (False, "")])
def test_a_file_that_cannot_be_imported_is_noticed_and_a_name_that_has_gone_is_not(
    broken, noticed, package, monkeypatch
):
    """Of both pytest says that there is no test of that name."""
    from tests.mutation import runner

    def main(_, plugins):
        if broken:
            plugins[0].pytest_collectreport(SimpleNamespace(failed=True, nodeid="test_some.py"))
        return pytest.ExitCode.USAGE_ERROR

    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(pytest, "main", main)
    assert runner._first_failing_test([["test_some.py::test_one"]]) == noticed


def test_a_sample_of_a_section_is_caught(tmp_path):
    """The tool at work on mutants of one section, seeded, by the equations' own checks."""
    command = [sys.executable, "-m", "tests.mutation", "paper/driven", "--checks", "--sample", "1"]
    run = subprocess.run(
        [*command, "--seed", "2", "--results", str(tmp_path)], cwd=ROOT, capture_output=True, text=True
    )
    assert run.returncode == 0 and run.stdout.count("caught") == 1, run.stdout + run.stderr
