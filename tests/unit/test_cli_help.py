"""Help and completion of the command line: units can be read, and names complete."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import click
import pytest
import typer
from typer.testing import CliRunner

from scarl_sionna.cli import app
from scarl_sionna.core.specs.lighting import LIGHTING_PRESETS
from scarl_sionna.core.specs.weather import WEATHER_PRESETS
from scarl_sionna.scenario.spec.scenario import scenario_names

REPO = Path(__file__).resolve().parents[2]
GROUP = typer.main.get_command(app)
UNIT = re.compile(r"\[[^\[\]]+\]")


def _helps(command: click.Command) -> list[str]:
    return [str(getattr(entry, "help", "") or "") for entry in command.params] + [command.help or ""]


@pytest.mark.parametrize("name", sorted(GROUP.commands))  # type: ignore[attr-defined]
def test_every_unit_of_a_help_text_is_shown(name: str) -> None:
    stated = {unit for text in _helps(GROUP.commands[name]) for unit in UNIT.findall(text)}  # type: ignore[attr-defined]
    result = CliRunner().invoke(app, [name, "--help"], env={"COLUMNS": "120"})
    assert result.exit_code == 0
    shown = " ".join(result.stdout.split())
    assert stated <= set(UNIT.findall(shown))


def test_there_are_units_to_show() -> None:
    """The test above can fail: several commands state seconds, degrees, hertz and metres."""
    stated = {
        (name, unit)
        for name, command in GROUP.commands.items()  # type: ignore[attr-defined]
        for text in _helps(command)
        for unit in UNIT.findall(text)
    }
    assert {("demo", "[s]"), ("demo", "[m]"), ("export", "[s]"), ("preview", "[Hz]"), ("rcs", "[deg]")} <= stated


def completed(words: str) -> list[str]:
    """Return what a shell would offer for the last word."""
    environment = {
        **os.environ,
        "_SCARL_SIONNA_COMPLETE": "complete_bash",
        "COMP_WORDS": words,
        "COMP_CWORD": str(len(words.split(" ")) - 1),
    }
    code = "from scarl_sionna.cli import app; app(prog_name='scarl-sionna')"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=REPO, env=environment, check=False
    )
    return done.stdout.split()


@pytest.mark.some(1)
@pytest.mark.parametrize(
    ("typed", "expected"),
    [
        ("pre", ["preview"]),
        ("demo --sce", ["--scenario", "--scene"]),
        ("demo --scene highway_g", ["highway_guardrail"]),
        ("demo --weather dr", ["drizzle"]),
        ("demo --method ray", ["raycast"]),
        ("export cut", [name for name in scenario_names() if name.startswith("cut")]),
    ],
)
def test_the_shell_completes_commands_options_and_names(typed: str, expected: list[str]) -> None:
    assert completed(f"scarl-sionna {typed}") == expected


def test_the_help_names_all_weathers_lightings_and_methods_that_need_no_more() -> None:
    shown = " ".join(CliRunner().invoke(app, ["export", "--help"], env={"COLUMNS": "300"}).stdout.split())
    assert f"{', '.join(WEATHER_PRESETS)} (default" in shown and "winter" in WEATHER_PRESETS
    assert f"{', '.join(LIGHTING_PRESETS)} (default" in shown
    assert "Radar channel: auto, raycast, sionna, sbr (default" in shown


def test_completion_can_be_installed() -> None:
    result = CliRunner().invoke(app, ["--help"])
    assert "--install-completion" in result.stdout
