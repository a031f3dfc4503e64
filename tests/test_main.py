"""The command line: help for everything, one clear line for bad input, and numbers that are the package's."""

import csv
import io
import json

import nbformat
import numpy as np
import pytest
from nbformat.v4 import new_code_cell, new_notebook

import cra_sym as cra
from cra_sym.__main__ import COMMANDS, main


def stop(arguments, capsys):
    """Run a command that argparse ends; return its exit code and what it wrote."""
    with pytest.raises(SystemExit) as end:
        main(arguments)
    return end.value.code, *capsys.readouterr()


def test_help_lists_every_command(capsys):
    code, out, _ = stop(["--help"], capsys)
    assert code == 0
    assert all(name in out and command.summary.split()[0] in out for name, command in COMMANDS.items())


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_command_has_help(name, capsys):
    code, out, err = stop([name, "--help"], capsys)
    assert (code, err) == (0, "")
    assert out.startswith(f"usage: python -m cra_sym {name}")


def test_frequencies_are_those_of_the_package(capsys):
    assert main(["frequencies", "--k-t", "1e4", "--m-e", "0.005", "--modes", "4", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    expected = cra.natural_frequencies(cra.Arm.nominal().replace(k_t=1e4, m_e=0.005), modes=4)
    np.testing.assert_array_equal(printed["frequency"], expected)


def test_table_and_csv_agree_with_the_published_frequencies(capsys):
    assert main(["frequencies", "--k-t", "inf", "--m-e", "0", "--csv"]) == 0
    rows = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    assert [f"{float(row['frequency / Hz']):.3f}" for row in rows] == ["2.448", "15.339", "42.950"]
    assert main(["frequencies", "--m-e", "0"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["mode", "1", "2", "3"]


def test_certified_bounds_enclose_the_frequencies(capsys):
    assert main(["certify", "--k-t", "1e4", "--json"]) == 0
    proof = json.loads(capsys.readouterr().out)
    found = cra.natural_frequencies(cra.Arm.nominal().replace(k_t=1e4))
    np.testing.assert_allclose([proof["lower"], proof["upper"]], [found, found], rtol=1e-13)
    assert np.all(np.less_equal(proof["lower"], proof["upper"]))
    assert main(["certify", "--k-t", "1e4"]) == 0
    assert "none is missed" in capsys.readouterr().out


def test_a_notebook_that_fails_is_no_usage_error(tmp_path, capsys):
    (tmp_path / "book").mkdir()
    cells = [new_code_cell("1 / 0")]
    nbformat.write(new_notebook(cells=cells), tmp_path / "book" / "00_trial.ipynb")
    out = tmp_path / "out"
    assert main(["reproduce", "--notebooks", str(tmp_path / "book"), "--output", str(out)]) == 1
    assert "ZeroDivisionError" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["book"]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--k-t", "-1"], ["k_t", "-1", "[0, inf]"]),
        (["--L", "0"], ["L", "0", "(0, inf)"]),
        (["--rho", "nan"], ["rho", "nan"]),
        (["--m-e", "inf"], ["m_e", "inf"]),
        (["--modes", "0"], ["modes", "0", "from 1"]),
    ],
)
def test_bad_values_are_named_in_one_line(arguments, told, capsys):
    assert main(["frequencies", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert all(word in err for word in told)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["frequencies", "--k-t", "soft"], ["--k-t", "soft"]),
        (["frequencies", "--modes", "1.5"], ["--modes", "1.5"]),
        (["figures", "--only", "fig99"], ["fig99", "fig01"]),
        (["sing"], ["sing", "frequencies"]),
        ([], ["COMMAND"]),
    ],
)
def test_bad_words_are_named_in_one_line(arguments, told, capsys):
    code, out, err = stop(arguments, capsys)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert all(word in err for word in told)


@pytest.mark.parametrize("command", ["reproduce", "figures"])
def test_an_unusable_output_folder_is_reported_first(command, tmp_path, capsys):
    (tmp_path / "taken").write_text("mine")
    assert main([command, "--output", str(tmp_path / "taken")]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert "taken" in err
    assert (tmp_path / "taken").read_text() == "mine"


def test_figures_are_drawn(tmp_path, capsys):
    assert main(["figures", "--only", "fig01", "--output", str(tmp_path / "my figures")]) == 0
    made = sorted(path.name for path in (tmp_path / "my figures").iterdir())
    assert made == ["fig01.png", "fig01.svg", "manifest.json"]
    assert all(str(tmp_path / "my figures" / name) in capsys.readouterr().out for name in made[:1])
