"""Pictures in folders: made whole, and the folders with them."""

import pytest
from matplotlib.figure import Figure

from cra_sym.files import OutputError
from cra_sym.report import pictures


def test_animations_make_their_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(pictures, "animate", lambda name: f"<svg>{name}</svg>")
    made = pictures.save_animations(tmp_path / "new" / "er")
    assert made and all(path.read_text() == f"<svg>{path.stem}</svg>" for path in made)
    assert sorted(made) == sorted((tmp_path / "new" / "er").iterdir())


def test_a_figure_that_cannot_be_saved_leaves_the_one_that_is_there(tmp_path, monkeypatch):
    (tmp_path / "fig02.svg").write_text("old")

    def half(self, place, **_):
        place.write_text("half of the new")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Figure, "savefig", half)
    with pytest.raises(OutputError, match=r"fig02\.svg': cannot be written \(No space"):
        pictures.save_figures(tmp_path, ["fig02"], kinds=["svg"])
    assert [path.read_text() for path in tmp_path.iterdir()] == ["old"]
