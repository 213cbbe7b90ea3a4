"""The order of the layers: as docs/architecture.md states it, and without exceptions."""

from __future__ import annotations

import tomllib
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
CONTRACTS = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["tool"]["importlinter"][
    "contracts"
]


def test_the_page_states_the_layers_that_are_checked() -> None:
    page = (REPOSITORY / "docs" / "architecture.md").read_text()
    layers = CONTRACTS[0]["layers"]
    assert "\n".join(f"    {layer}" for layer in layers) in page


def test_no_import_is_excused_from_a_contract() -> None:
    excused = [one for contract in CONTRACTS for one in contract.get("ignore_imports", ())]
    assert excused == []
