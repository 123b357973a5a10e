"""Programs on a terminal end at an expected error with one line and exit code 1."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from serving import PATIENCE_S, REPOSITORY

import hbot


@pytest.mark.parametrize("page", ["docs/clients.md", "clients/python/README.md"])
def test_the_programs_of_the_pages_name_a_missing_server(page: str) -> None:
    text = (REPOSITORY / page).read_text("utf-8")
    programs = [
        block for block in re.findall(r"(?s)```python\n(.*?)```", text) if "hbot.connect(" in block
    ]
    assert programs
    for block in programs:
        code, given = re.subn(r'hbot\.connect\("[^"]*"', 'hbot.connect("127.0.0.1:1"', block)
        done = subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, "HBOT_SERVER": "127.0.0.1:1"},
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
        )
        assert done.returncode == 1
        (line,) = done.stderr.splitlines()
        assert line.startswith("error: no connection to 127.0.0.1:1: ")
        assert "`hbot server`" in line
        assert ("HBOT_SERVER" in line) == (not given), "only where the variable counts"


def test_the_program_of_the_page_names_a_missing_recording(tmp_path: Path) -> None:
    text = (REPOSITORY / "docs/recordings.md").read_text("utf-8")
    (code,) = (b for b in re.findall(r"(?s)```python\n(.*?)```", text) if "hbot.mcap" in b)
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env={**os.environ, "MPLBACKEND": "agg"},  # The page's plot needs no display.
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
    )
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    # The library of the plot can print a line of its own when it is first used.
    assert re.fullmatch(r"error: .*No such file.*'run\.mcap'", done.stderr.splitlines()[-1])


@pytest.mark.parametrize(
    ("address", "message"),
    [("127.0.0.1:1", "no connection to"), ("127.0.0.1:99999", "the port is '99999'")],
)
def test_a_block_ends_the_program(
    address: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended, hbot.one_line_errors():
        hbot.connect(address)
    assert ended.value.code == 1
    assert isinstance(ended.value.__cause__, hbot.HbotError)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: ")
    assert message in line


def test_a_file_that_is_missing_is_an_expected_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit), hbot.one_line_errors():
        (tmp_path / "token").read_text()
    assert re.fullmatch(r"error: .*No such file.*token'\n", capsys.readouterr().err)


def test_a_program_names_its_own_errors(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit), hbot.one_line_errors(EOFError, KeyError):
        raise EOFError
    assert capsys.readouterr().err == "error: EOFError\n"


def test_other_exceptions_pass(capsys: pytest.CaptureFixture[str]) -> None:
    """Those of a mistake in the program need their traceback."""
    with pytest.raises(ZeroDivisionError), hbot.one_line_errors():
        _ = 1 / 0
    assert capsys.readouterr().err == ""


def test_a_reader_that_has_enough_ends_the_program_without_a_word() -> None:
    code = """if True:
        import hbot
        with hbot.one_line_errors():
            while True:
                print("a line", flush=True)
    """
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as program:
        assert program.stdout is not None
        assert program.stderr is not None
        program.stdout.readline()
        program.stdout.close()
        assert program.stderr.read() == ""
        assert program.wait(PATIENCE_S) == 1
