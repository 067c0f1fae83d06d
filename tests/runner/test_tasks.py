"""Tasks: every call is answered once, within its limits, whatever becomes of those who asked."""

import os
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

from verify.runner import tasks
from verify.runner.child import watch_all
from verify.runner.tasks import Failure, Limits, Task, made


@dataclass(frozen=True)
class Product:
    """The result of a task."""

    value: float
    of: tuple[int, int]


def product(a: int, b: int, log: str) -> list[Product]:
    with open(log, "a", encoding="utf-8") as file:
        file.write(f"{a}\n")
    return [Product(float("inf") if a == 0 else a * b, (a, b))]


def stuck(log: str) -> float:
    raise ValueError(f"not {log}") if log else SystemExit(3)


def greedy(log: str) -> float:
    return float(sum(bytearray(400_000_000)[::4096])) + time.sleep(600)


def asked(log):
    return [int(line) for line in log.read_text(encoding="utf-8").split()]


@pytest.fixture
def found_by_name(monkeypatch):
    """A process finds this module by its name, as modules of the project."""
    here = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
    monkeypatch.setenv("PYTHONPATH", here)
    monkeypatch.setattr(tasks, "code_digest", lambda *modules: "this code")


def products(log, numbers=(2, 0, 5)):
    return [
        Task(f"{a} b", product, {"a": a, "b": 3, "log": str(log)}, ("a:Guest",)) for a in numbers
    ]


@pytest.fixture
def guest(monkeypatch, found_by_name):
    """Each in a fresh process: a forked one has the path of the server."""
    monkeypatch.setattr(tasks, "code_of_solver", lambda name: name)
    monkeypatch.setattr(tasks, "find_solver", lambda name: name)


def test_every_call_is_answered_in_order_and_made_once(tmp_path, guest, monkeypatch):
    """A study that was broken off goes on with the rest."""
    log, said = tmp_path / "log", []

    def stop(text):
        said.append(text)
        if len(said) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        made(products(log), tmp_path / "kept", stop)
    assert asked(log)[:2] == [2, 0]
    found = made(products(log), tmp_path / "kept", said.append, Limits(2))
    inf = float("inf")
    assert found == [[Product(6, (2, 3))], [Product(inf, (0, 3))], [Product(15, (5, 3))]]
    assert said[-1].endswith("3 of 3 parts")
    again = made(products(log, (5, 2, 7)), tmp_path / "kept", limits=Limits(2))
    assert [one[0].value for one in again] == [15.0, 6.0, 21.0]
    assert sorted(asked(log)) == [0, 2, 5, 7]
    kept = {path.name.split("-")[0] for path in (tmp_path / "kept").iterdir()}
    assert len(kept) == 3  # other tasks are gone
    monkeypatch.setattr(tasks, "code_digest", lambda *modules: "other code")
    made(products(log, (2,)), tmp_path / "kept")
    assert sorted(asked(log)) == [0, 2, 2, 5, 7]


def test_what_fails_says_why_and_costs_the_others_nothing(tmp_path, guest):
    limits = Limits(jobs=4, memory=300e6)
    log = str(tmp_path / "log")
    four = [
        Task("raises", stuck, {"log": "x"}, ("a:Guest",)),
        Task("leaves", stuck, {"log": ""}, ("a:Guest",)),
        Task("is large", greedy, {"log": ""}, ("a:Guest",)),
        Task("is well", product, {"a": 2, "b": 3, "log": log}, ("a:Guest",)),
    ]
    raised, left, large, well = made(four, tmp_path / "kept", limits=limits, may_fail=True)
    assert raised == Failure("ValueError: not x")
    assert isinstance(left, Failure)
    assert "exit code 3" in left.reason
    assert large == Failure("killed above 300 MB")
    assert well == [Product(6.0, (2, 3))]
    with pytest.raises(ChildProcessError, match="raises: ValueError: not x"):
        made(four[:1], tmp_path / "kept")


class Waiting:
    """Something under way that ends when it is looked at for the `count`th time."""

    def __init__(self, count):
        self.left, self.killed = count, False

    def poll(self):
        self.left -= 1
        return None if self.left else "done"

    def kill(self):
        self.killed = True


@pytest.mark.parametrize("stops", ["look", "ended"])
def test_what_is_under_way_is_ended_when_the_watch_is_broken_off(stops):
    every, looks = [Waiting(1), Waiting(9), Waiting(9)], []

    def look():
        looks.append(1)
        if stops == "look" and len(looks) == 2:
            raise KeyboardInterrupt

    def ended(number, found):
        assert (number, found) == (0, "done")
        if stops == "ended":
            raise OSError

    with pytest.raises((KeyboardInterrupt, OSError)):
        watch_all([lambda one=one: one for one in every], ended, 2, look)
    assert [one.killed for one in every] == [False, True, False]
    assert every[2].left == 9  # it had not begun
