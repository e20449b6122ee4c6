"""Every notebook, run from its first cell to its last."""

from pathlib import Path

import nbformat
import pytest
from conftest import ROOT
from nbclient import NotebookClient

NOTEBOOKS = sorted((ROOT / "python/notebooks").glob("*.ipynb"))
SAYS = {
    "comparing-controllers": ["virtual seconds", "thrust_rms_n"],
    "real-log": ["unexplained", "damping_level", "found at"],
    "recording-to-diagnosis": ["explained", "coulomb_friction", "no_mismatch"],
}


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MPLBACKEND", raising=False)  # the kernel's own shows a figure below its cell
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    # In a folder that lies as deep as its own: what it writes is not left in the repository.
    (tmp_path / "python/notebooks").mkdir(parents=True)
    (tmp_path / "tests").symlink_to(ROOT / "tests")
    resources = {"metadata": {"path": str(tmp_path / "python/notebooks")}}
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources=resources).execute()
    said = str([cell.get("outputs") for cell in notebook.cells])
    for words in SAYS[path.stem]:
        assert words in said, f"{words} is not in what {path.name} says"
    assert "image/png" in said, "it shows no plot"


def test_there_are_three() -> None:
    assert {path.stem for path in NOTEBOOKS} == SAYS.keys()
