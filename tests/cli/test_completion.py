"""Completion in a shell: bash reads the script, and then knows commands, options and cases."""

import subprocess

import pytest

from verify.cli.main import main


@pytest.mark.parametrize(
    ("words", "completed"),
    [
        (["desc"], "describe"),
        (["run", "--qu"], "--quick"),
        (["run", "statics/f1_p"], "statics/f1_patch"),
        (["describe", "meeting/three"], "meeting/three_through_a_point"),
    ],
)
def test_bash_completes(capsys, tmp_path, words, completed):
    assert main(["completion", "bash"]) == 0
    script = tmp_path / "verify.bash"
    script.write_text(capsys.readouterr().out, encoding="utf-8")
    typed = f"COMP_WORDS=(verify {' '.join(words)}); COMP_CWORD={len(words)}"
    asked = f'source {script}; {typed}; _shtab_verify; echo "${{COMPREPLY[@]}}"'
    done = subprocess.run(
        ["bash", "-c", asked], cwd=tmp_path, capture_output=True, text=True, timeout=30, check=True
    )
    assert done.stdout.split() == [completed]


def test_zsh_gets_a_script_with_the_cases(capsys):
    assert main(["completion", "zsh"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("#compdef verify")
    assert "statics/f1_patch" in said
