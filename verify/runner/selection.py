"""Options of a run, and selection of its cases by name, file, pattern, ``-k`` or weight."""

import re
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.scene import RatioCheck, Scene, list_cases, load_scenes
from verify.scene.loading import row_asked

Predicate = Callable[[Scene], bool]
_TOKEN = re.compile(r"\(|\)|[^\s()]+")
_PATHS = ("cache", "references")


def select_cases(
    names: Sequence[str] = (), expression: str | None = None, weight: str = "normal"
) -> list[Scene]:
    """Load the cases that a command line asks for.

    Parameters
    ----------
    names : sequence of str
        Names of cases, of their folders (``statics``), patterns (``statics/f*``) or paths of case
        files; none: all cases. A row of a case with a parameter is
        ``slivers/plane[epsilon=0.01]``; with it comes the row that it is compared with.
    expression : str, optional
        Words with and, or, not and parentheses; a word is looked for in name, title and tags.
    weight : {"quick", "normal", "heavy"}
        ``quick``: only cases tagged quick; ``normal``: all but those tagged heavy;
        ``heavy``: all. A case that is named runs whatever its weight.

    Returns
    -------
    list of Scene
        Empty if nothing matches.

    Raises
    ------
    InputError
        If a name, a file or the expression is bad, or two cases have the same name.
    """
    wanted = parse_expression(expression) if expression is not None else None
    chosen: dict[str, Scene] = {}
    for source, is_named in _sources(names).items():
        named = load_scenes(source)
        row = row_asked(source)
        rows = load_scenes(row[0]) if row else named
        asked = [
            scene
            for scene in named
            if (is_named or (_of_weight(scene, weight) and not scene.played_only))
            and (wanted is None or wanted(scene))
        ]  # every solver would refuse a case that is for `verify play`
        for scene in _with_rows_compared(asked, rows):
            twin = chosen.setdefault(scene.name, scene)
            if twin.file != scene.file:
                raise InputError(
                    f"another case is called '{scene.name}' too ({twin.file}); rename one",
                    str(scene.file),
                )
    return list(chosen.values())


def _with_rows_compared(asked: list[Scene], rows: list[Scene]) -> list[Scene]:
    """Add the rows with which those that are asked are compared, in the order of the case."""
    checks = [c for scene in asked for c in scene.acceptance if isinstance(c, RatioCheck)]
    wanted = {check.row for check in checks if check.row is not None}
    names = {scene.name for scene in asked}
    return [s for s in rows if s.name in names or (s.row is not None and s.row.value in wanted)]


def parse_expression(text: str) -> Predicate:
    """Turn ``"demo and not (tissue or griffith)"`` into a predicate of scenes.

    Raises
    ------
    InputError
        If the text is not such an expression.
    """
    tokens = _TOKEN.findall(text)
    predicate, rest = _joined(tokens, text)
    if rest:
        raise _bad(text, f"unexpected '{rest[0]}'")
    return predicate


def _joined(tokens: list[str], text: str, word: str = "or") -> tuple[Predicate, list[str]]:
    """Read terms that are joined by ``or``, or by ``and``, which binds closer."""
    inner = partial(_joined, word="and") if word == "or" else _term
    first, rest = inner(tokens, text)
    parts = [first]
    while rest and rest[0].lower() == word:
        part, rest = inner(rest[1:], text)
        parts.append(part)
    holds = any if word == "or" else all
    return (lambda scene: holds(part(scene) for part in parts)), rest


def _term(tokens: list[str], text: str) -> tuple[Predicate, list[str]]:
    if not tokens:
        raise _bad(text, "a word is missing at its end")
    word, rest = tokens[0], tokens[1:]
    if word.lower() == "not":
        inner, rest = _term(rest, text)
        return (lambda scene: not inner(scene)), rest
    if word == "(":
        inner, rest = _joined(rest, text)
        if not rest or rest[0] != ")":
            raise _bad(text, "a ')' is missing")
        return inner, rest[1:]
    if word == ")" or word.lower() in ("and", "or"):
        raise _bad(text, f"a word is missing before '{word}'")
    return (lambda scene: _mentions(scene, word)), rest


def _mentions(scene: Scene, word: str) -> bool:
    return any(word.lower() in text.lower() for text in (scene.name, scene.title, *scene.tags))


def _bad(text: str, why: str) -> InputError:
    return InputError(f"-k '{text}': {why}; expected e.g. -k 'demo and not (tissue or f3)'")


def _sources(names: Sequence[str]) -> dict[str, bool]:
    """Case names and files, and whether each was named itself (not matched by a pattern)."""
    known = list_cases()
    sources: dict[str, bool] = {}
    for name in names:
        pattern = any(mark in name for mark in "*?[") and not name.endswith(".toml")
        folder = [case for case in known if case.startswith(f"{name.rstrip('/')}/")]
        if folder or (pattern and row_asked(name) is None):
            if not (found := folder or [case for case in known if fnmatchcase(case, name)]):
                raise InputError(f"no case matches '{name}'; `verify list` shows them all")
            for case in found:
                sources.setdefault(case, False)
        else:
            sources[name] = True
    return sources if names else dict.fromkeys(known, False)


def _of_weight(scene: Scene, weight: str) -> bool:
    if weight == "quick":
        return "quick" in scene.tags
    return weight == "heavy" or "heavy" not in scene.tags


@dataclass(frozen=True)
class Options:
    """Options of a run.

    Parameters
    ----------
    solvers : tuple of str
        The solvers compared; empty: those that the case's acceptance names, with ``xfem`` and
        ``conforming``. The conforming reference of a case without exact solution runs in any
        case.
    repetitions : int
        Timed repetitions of each solve, after the first call, which compiles.
    parameters : dict of str to dict
        Parameters by solver.
    jobs : int
        Processes at the same time.
    timeout : float
        Wall seconds after which a solve is killed.
    memory : float or None
        Bytes of resident memory above which a solve is killed; default: 80 % of the machine's,
        shared by `jobs`.
    cache : Path or None
        Folder of references that were solved before; None: every run solves its own.
    references : Path or None
        A bundle of references, which judges instead of solving any.
    cluster : str or None
        Scheduler of a Dask cluster whose workers solve; None: processes of this machine do.
    ranks : int
        MPI ranks of each reference.
    judge_only : tuple of str
        Solvers that are judged; empty: all that are asked and do not refuse the case.
    within : float or None
        Seconds in which the reference of each case shall end: with larger elements, by a forecast
        from the case alone, and without its finest levels, by one from those that are solved.
    judged : bool
        Whether the references that judge are solved with the rest; without them only `solvers` run.
    imported : tuple of str
        Programs whose answers lie in the run directory: they are compared with the solves. Then
        only `solvers` run, those that checks compare with if they are installed, and the reference.
    """

    solvers: tuple[str, ...] = ()
    repetitions: int = 3
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    jobs: int = 1
    timeout: float = 600.0
    memory: float | None = None
    cache: Path | None = None
    references: Path | None = None
    cluster: str | None = None
    ranks: int = 1
    judge_only: tuple[str, ...] = ()
    within: float | None = None
    judged: bool = True
    imported: tuple[str, ...] = ()

    def of_result(self) -> dict[str, Any]:
        """Return the options that change numbers; a resumed run must have the same."""
        return {
            "solvers": list(self.solvers),
            "repetitions": self.repetitions,
            "parameters": self.parameters,
            **({"within": self.within} if self.within else {}),
        }

    def record(self) -> dict[str, Any]:
        """Return all of them as plain values."""
        paths = {name: str(v) if (v := getattr(self, name)) else None for name in _PATHS}
        names = {name: list(getattr(self, name)) for name in ("solvers", "judge_only", "imported")}
        return {**asdict(self), **paths, **names}
