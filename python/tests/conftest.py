"""The package as installed, with the repository's recordings; without KORT (the program) what compares with it is left out."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def cases() -> Path:
    """Recordings with what hides in them."""
    return ROOT / "tests/recordings/example-cases"


@pytest.fixture(scope="session")
def kort_program() -> str:
    """The program of the same build."""
    program = os.environ.get("KORT")
    if program is None:
        pytest.skip("KORT does not name the program")
    return program
