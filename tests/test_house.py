"""The house rules: who may import whom, how large a module may be, what the public face and the documents promise."""

from __future__ import annotations

import ast
import inspect
import json
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from functools import lru_cache
from importlib import import_module
from pathlib import Path

import pytest

import cra_sym

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "cra_sym"
MODULES = sorted(PACKAGE.rglob("*.py"))
# From the ground up. A room imports from the floors below; rooms of the ground floor know only the symbols.
FLOORS = [
    {"symbols", "mechanics", "kernels", "solvers"},
    {"model"},
    {"analysis", "arm"},
    {"paper"},
    {"studies", "codegen", "figures", "explorer"},
    {"claims"},
    {"report"},
    {"__main__"},
]
OPEN_TO_ALL = {"cached", "checks", "ending", "extras", "files", "si", "symbols"}  # safe writing, units and the like
RANK = {room: rank for rank, floor in enumerate(FLOORS) for room in floor}
STRANGERS = ({"mechanics", "kernels", "solvers"}, {"analysis", "arm"})  # rooms that do not know each other
# A module that names one of a higher room, to load it when a function asks for it: the only ways up.
UPWARDS = {
    ("cra_sym/model/asked.py", "analysis"),  # a model has its tools at hand
}
KNOW_ORACLES = {"paper", "claims"}
SELF = {"self", "cls"}
# Private in name, yet part of a documented interface: of named tuples, of SymPy's printers, of IPython.
DOCUMENTED = re.compile(r"_replace|_asdict|_print(_\w+)?|_repr_\w+_")
TO_THE_PACKAGE = {("cra_sym", "_HOME"), ("cra_sym", "_LOADED")}  # where the public names live; when it was imported


def name_of(module: Path) -> str:
    return module.relative_to(ROOT).as_posix()


@pytest.fixture(scope="module", params=MODULES, ids=name_of)
def module(request: pytest.FixtureRequest) -> Path:
    """Each module of the package; all tests of one follow each other, so that it is read once."""
    return request.param


@lru_cache(maxsize=1)
def parsed(module: Path) -> ast.Module:
    return ast.parse(module.read_text(encoding="utf-8"))


def imported(module: Path) -> set[str]:
    """Absolute dotted names of everything a module imports, at its top or inside functions."""
    package = list(module.relative_to(ROOT).parts[:-1])
    names: set[str] = set()
    for node in ast.walk(parsed(module)):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            origin = ".".join(base + ([node.module] if node.module else []))
            names.update(f"{origin}.{alias.name}" for alias in node.names)
    return names


def trespasses(module: Path) -> list[str]:
    """Imports of ``module`` that lead upwards or across the ground floor."""
    home = module.relative_to(PACKAGE).parts[0].removesuffix(".py")
    if home == "__init__":
        return []
    bad = []
    for name in imported(module):
        parts = name.split(".")
        room = parts[1] if parts[0] == "cra_sym" and len(parts) > 1 else None
        if room is None or room == home or room in OPEN_TO_ALL or room not in RANK:
            continue
        across = any({home, room} <= rooms for rooms in STRANGERS)
        upwards = RANK[room] > RANK.get(home, -1) and (name_of(module), room) not in UPWARDS
        if across or upwards:
            bad.append(name)
    return bad


def named_in_text(module: Path) -> set[str]:
    """Dotted names of the package in strings, from which a module is loaded on demand."""
    texts = (n.value for n in ast.walk(parsed(module)) if isinstance(n, ast.Constant))
    names = (re.fullmatch(r"(cra_sym\.[\w.]+)(:\w+)?", text) for text in texts if isinstance(text, str))
    return {name[1] for name in names if name}


def test_imports_lead_downwards(module):
    assert trespasses(module) == []


def test_loading_on_demand_leads_downwards_but_for_the_ways_up(module):
    home = module.relative_to(PACKAGE).parts[0].removesuffix(".py")
    rooms = {name.split(".")[1] for name in named_in_text(module)}
    up = {(name_of(module), room) for room in rooms if home in RANK and RANK.get(room, -1) > RANK[home]}
    assert up == {way for way in UPWARDS if way[0] == name_of(module)}


def test_second_routes_serve_proofs_and_claims_only(module):
    used = {name for name in imported(module) | named_in_text(module) if name.startswith("cra_sym.paper.oracles")}
    assert not used or module.relative_to(PACKAGE).parts[0] in KNOW_ORACLES


def test_every_room_has_a_floor():
    rooms = {path.name.removesuffix(".py") for path in PACKAGE.iterdir() if path.suffix == ".py" or path.is_dir()}
    assert rooms - {"__init__", "__pycache__"} <= set(RANK) | OPEN_TO_ALL
    assert {way for way, _ in UPWARDS} <= set(map(name_of, MODULES))


def test_the_import_rule_sees_a_trespass(tmp_path, monkeypatch):
    planted = tmp_path / "cra_sym" / "solvers" / "planted.py"
    planted.parent.mkdir(parents=True)
    planted.write_text(
        "def f():\n    from ..mechanics import hamilton\n    from cra_sym import figures, checks, symbols\n"
        "    return derived_kernel('cra_sym.paper.oracles.shooting:characteristic'), f'cra_sym.report.{f}'\n"
    )
    monkeypatch.setitem(globals(), "ROOT", tmp_path)
    monkeypatch.setitem(globals(), "PACKAGE", tmp_path / "cra_sym")
    assert sorted(trespasses(planted)) == ["cra_sym.figures", "cra_sym.mechanics.hamilton"]
    assert named_in_text(planted) == {"cra_sym.paper.oracles.shooting", "cra_sym.report."}
    with pytest.raises(AssertionError):
        test_second_routes_serve_proofs_and_claims_only(planted)


def test_the_import_rule_sees_rooms_that_must_not_know_each_other(tmp_path, monkeypatch):
    monkeypatch.setitem(globals(), "ROOT", tmp_path)
    monkeypatch.setitem(globals(), "PACKAGE", tmp_path / "cra_sym")
    for home, other in (("analysis", "arm"), ("arm", "analysis"), ("kernels", "solvers")):
        planted = tmp_path / "cra_sym" / home / "planted.py"
        planted.parent.mkdir(parents=True)
        planted.write_text(f"from cra_sym.{other}.modes import modes\n")
        assert trespasses(planted) == [f"cra_sym.{other}.modes.modes"]


def private_reads(module: Path) -> list[str]:
    """Private names that ``module`` imports or reads from objects whose class it does not define.

    Of an argument the annotation tells its class; of any other object the module must have such an attribute itself.
    """
    tree = parsed(module)
    classes = {node.name for node in ast.walk(tree) if isinstance(node, ast.ClassDef)}
    own, bad = own_names(tree), []
    for node, arguments in with_arguments(tree, {}):
        if isinstance(node, ast.ImportFrom):
            bad += [alias.name for alias in node.names if re.match(r"_[^_]", alias.name)]
        if not isinstance(node, ast.Attribute) or not re.match(r"_[^_]", node.attr) or DOCUMENTED.fullmatch(node.attr):
            continue
        holder = ast.unparse(node.value)
        kind = arguments.get(holder)
        foreign = kind is not None and not classes & set(re.findall(r"\w+", kind)) and kind not in {"object", "Any"}
        if holder not in SELF and (foreign or node.attr not in own) and (holder, node.attr) not in TO_THE_PACKAGE:
            bad.append(ast.unparse(node))
    return bad


def own_names(tree: ast.Module) -> set[str]:
    """Attributes that the classes of a module define: methods, fields, slots and what is assigned to ``self``."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.AnnAssign)):
            found.add(node.name if isinstance(node, ast.FunctionDef) else ast.unparse(node.target))
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store) and ast.unparse(node.value) in SELF:
            found.add(node.attr)
        elif isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__slots__":
            found |= set(ast.literal_eval(node.value))
    return found


def with_arguments(node: ast.AST, known: dict[str, str]) -> Iterator[tuple[ast.AST, dict[str, str]]]:
    """Yield every node below one with the annotations of the arguments of the functions around it."""
    if isinstance(node, ast.FunctionDef):
        given = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
        known = known | {a.arg: ast.unparse(a.annotation).strip("'") for a in given if a.annotation}
    yield node, known
    for child in ast.iter_child_nodes(node):
        yield from with_arguments(child, known)


def test_private_names_stay_in_their_module(module):
    assert private_reads(module) == []


def test_the_rule_of_private_names_sees_a_trespass(tmp_path):
    planted = tmp_path / "planted.py"
    planted.write_text(
        "from cra_sym.solvers.other import _step, known\n"
        "class Own:\n    _a: int\n    def __init__(self): self._b = 0\n"
        "    def f(self, other: Own, state: State, free): return other._a, other._b, state._b, free._b, free._c\n"
        "    def g(self, t): return t._replace(x=1), super()._print_Pow(t), known._private, self.one._of_others\n"
    )
    assert sorted(private_reads(planted)) == ["_step", "free._c", "known._private", "self.one._of_others", "state._b"]


def test_solvers_know_numbers_only(module):
    assert module.parent.name != "solvers" or "sympy" not in {name.split(".")[0] for name in imported(module)}


def test_one_way_of_compiling(module):
    """Machine code is made in one place, which stores it where nobody else can have put it."""
    assert module.parent.name == "kernels" or "llvmlite" not in {name.split(".")[0] for name in imported(module)}
    assert ("emit_object" in module.read_text(encoding="utf-8")) == (name_of(module) == "cra_sym/kernels/machine.py")


def test_module_reads_in_one_sitting(module):
    assert len(module.read_text(encoding="utf-8").splitlines()) <= 420


def test_no_two_classes_of_one_name():
    found: dict[str, list[str]] = {}
    for path in MODULES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef):
                found.setdefault(node.name, []).append(name_of(path))
    assert {name: places for name, places in found.items() if len(places) > 1} == {}


def test_no_text_is_evaluated(module):
    """No eval, no exec outside the kernel store, and SymPy never parses a string it is handed."""
    for node in ast.walk(parsed(module)):
        if not isinstance(node, ast.Call):
            continue
        called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        bare = isinstance(node.func, ast.Name)
        assert not (bare and called == "eval"), node.lineno
        assert not (bare and called == "exec") or module.parent.name == "kernels", node.lineno
        assert called not in {"parse_expr", "parse_latex"}, node.lineno
        assert not (bare and called == "S"), f"S(...) reads text, line {node.lineno}"
        if called == "sympify":
            strict = [k.value for k in node.keywords if k.arg == "strict"]
            assert strict and getattr(strict[0], "value", False) is True, (
                f"sympify(..., strict=True), line {node.lineno}"
            )


def test_public_things_are_documented(module):
    tree = parsed(module)
    assert ast.get_docstring(tree), "module docstring"
    for node in tree.body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not node.name.startswith("_"):
            signature = any(getattr(decorator, "id", "") == "overload" for decorator in node.decorator_list)
            assert signature or ast.get_docstring(node), node.name


def tracked_texts() -> list[Path]:
    kinds = {
        ".py",
        ".pyi",
        ".md",
        ".ipynb",
        ".txt",
        ".toml",
        ".cfg",
        ".cff",
        ".mplstyle",
        ".jinja",
        ".css",
        ".yml",
        ".yaml",
        ".bib",
    }
    folders = [ROOT / name for name in ("cra_sym", "notebooks", "tests", ".ci", ".github")]
    files = [path for folder in folders for path in folder.rglob("*")] + list(ROOT.iterdir())
    hidden = {".ipynb_checkpoints", "__pycache__"}
    return sorted(
        p
        for p in files
        if p.is_file() and (p.suffix in kinds or p.name in {"Makefile", "run"}) and not hidden & {*p.parts}
    )


@pytest.mark.parametrize("path", tracked_texts(), ids=name_of)
def test_no_path_of_a_machine(path):
    machine = re.compile(r"(?<![\w.$~<>}])/(?:home|root|Users|work|tmp|opt|var)/\w|[A-Z]:\\\\?Users|\bfile:///")
    found = machine.search(path.read_text(encoding="utf-8"))
    assert found is None, found


def test_no_turns_that_a_native_reader_stumbles_on():
    """'must be ...' for 'allowed is ...', 'is not a ...' for 'is no ...'; there may be no such thing all the same."""
    turn = re.compile(r"allowed (?:is|are)\b|(?<!there )\b(?:is|are) no (?!longer|more)\w+", re.IGNORECASE)
    found = {}
    for path in tracked_texts():
        text = path.read_text(encoding="utf-8")
        if path.suffix == ".ipynb":
            text = " ".join("".join(cell["source"]) for cell in json.loads(text)["cells"])
        words = " ".join(re.sub(r"[#*>\"]+ ?", " ", text).split())
        if path != Path(__file__) and (turns := turn.findall(words)):
            found[name_of(path)] = turns
    assert found == {}


def test_import_is_cheap():
    """Importing the package loads no derivation, no plotting and no solver; nor does importing any room's name."""
    heavy = "{'sympy', 'matplotlib', 'scipy', 'llvmlite'}"
    code = f"import sys, cra_sym; dir(cra_sym); print(sorted({heavy} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True).stdout == "[]\n"


@pytest.mark.parametrize("name", sorted(cra_sym._HOME))
def test_public_name_has_a_home(name):
    home = import_module(f"cra_sym.{cra_sym._HOME[name]}")
    assert getattr(cra_sym, name) is getattr(home, name)
    assert getattr(home, name).__doc__


@pytest.mark.parametrize("name", sorted(cra_sym._HOME))
def test_public_arguments_and_results_have_types(name):
    thing = getattr(cra_sym, name)
    found = [thing, *(vars(thing).values() if inspect.isclass(thing) else ())]
    for one in filter(inspect.isfunction, found):
        untyped = [argument for argument, kind in one.__annotations__.items() if re.search(r"\bAny\b", str(kind))]
        assert one.__name__.startswith("_") or not untyped, (one.__qualname__, untyped)


def test_stub_tells_the_same_names():
    homes = {}
    for node in ast.parse((PACKAGE / "__init__.pyi").read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom) and node.level:
            assert all(alias.asname == alias.name for alias in node.names), "import A as A makes a stub name public"
            homes.update({alias.name: node.module for alias in node.names})
    assert homes == cra_sym._HOME


def test_readme_commands_exist():
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M))
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    named = set(re.findall(r"(?:^|`)make ([a-z]+)", readme, re.M))
    assert {"reproduce", "test", "lab", "notebooks"} <= named <= targets


def test_links_of_documents_lead_somewhere():
    for document in [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / ".github").glob("*.md")]:
        links = re.findall(r"\]\((?!https?:|#)([^)#]+)", document.read_text(encoding="utf-8"))
        assert [link for link in links if not (document.parent / link).exists()] == []


def test_readme_tells_where_each_equation_lives():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| \((\d+)\)(?:-\((\d+)\))? .*?`(paper/\w+)\.py`", readme, re.M)
    told = {n: home.replace("/", ".") for first, last, home in rows for n in range(int(first), int(last or first) + 1)}
    assert told == {e.number: e.source.partition(":")[0].removeprefix("cra_sym.") for e in cra_sym.equations()}


def test_readme_pictures_are_small():
    pictures = re.findall(r"!\[[^]]+\]\((?!https:)([^)]+)\)", (ROOT / "README.md").read_text(encoding="utf-8"))
    assert len(pictures) == 2
    assert all((ROOT / picture).stat().st_size < 200_000 for picture in pictures)


def test_badges_of_the_readme_are_true():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    pythons = re.findall(r"Python :: (3\.\d+)", "\n".join(project["classifiers"]))
    assert "Typing :: Typed" in project["classifiers"] and (PACKAGE / "py.typed").exists()
    badges = re.findall(r"^\[!\[([^]]+)\]\(https://img", (ROOT / "README.md").read_text(encoding="utf-8"), re.M)
    assert badges == [f"Python {pythons[0]} to {pythons[-1]}", f"Licence {project['license']}", "Typed"]


def test_fast_selection_exists():
    selected = (ROOT / "tests" / "fast.txt").read_text(encoding="utf-8").split()
    assert [name for name in selected if not (ROOT / name).exists()] == []


def test_top_level_is_small():
    """What lies beside the package is known by name; what a run leaves behind is not committed."""
    done = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        pytest.skip("not a git checkout")
    folders = {"cra_sym", "notebooks", "tests", ".ci", ".github"}
    documents = {"README.md", "CHANGELOG.md", "CONTRIBUTING.md", "CITATION.cff", "LICENSE"}
    settings = {"Makefile", "pyproject.toml", "requirements.txt", ".gitignore", ".pre-commit-config.yaml"}
    there = {name.partition("/")[0] for name in done.stdout.splitlines()}
    assert there == folders | documents | settings
