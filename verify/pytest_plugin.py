"""pytest plugin: one test per acceptance check of a case and solver.

Two ways in. Case files are collected (``*.verify.toml``, and what the ini option ``verify_cases``
names), or a test function is marked ``@pytest.mark.verify("case")``. It becomes one test per check
and solver, whose body runs if the check passes. Its fixtures are ``verify_check`` (a
`VerdictRecord`) and ``verify_result`` (a `CaseResult`).

The solvers come from the ini option ``verify_solvers``, else ``xfem`` and those that the checks
name. FAIL and ERROR fail; a FAIL that the case lists as a known finding is an expected failure.
UNDECIDED is skipped with its reason, because nothing was found out; with ``--verify-strict`` it
fails. So is a check of a solver that refuses the case. A case is run once per process, through
the runner, in a temporary directory (or ``--verify-out``, where a later session reuses finished
solves).
"""

import tempfile
from collections.abc import Iterable, Iterator
from fnmatch import fnmatch
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from verify.result import CaseResult, SolveRecord, VerdictRecord
    from verify.runner.selection import Options
    from verify.scene import Scene

_OWN_FILES = "*.verify.toml"
_RUNS = pytest.StashKey["_Runs"]()
_NO_CHECK = "no-acceptance"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Declare the options and ini values."""
    group = parser.getgroup("verify", "verification cases")
    group.addoption(
        "--verify-strict", action="store_true", help="an UNDECIDED check fails instead of a skip"
    )
    group.addoption("--verify-out", metavar="DIR", help="keep the runs below DIR, and resume them")
    parser.addini("verify_cases", "case files to collect: patterns below rootdir", "args", [])
    parser.addini("verify_strict", "an UNDECIDED check fails instead of a skip", "bool", False)
    parser.addini("verify_solvers", "solvers to run and judge, e.g. my_module:MySolver", "args", [])
    parser.addini("verify_timeout", "wall seconds after which a solve is killed", default="600")
    parser.addini("verify_references", "bundle of references to judge by, below rootdir")


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marker; make room for the runs."""
    config.addinivalue_line(
        "markers", "verify(case): a test per acceptance check of the case and solver"
    )
    config.stash[_RUNS] = _Runs(config)


def pytest_unconfigure(config: pytest.Config) -> None:
    """Remove the runs, unless they are to be kept."""
    if (runs := config.stash.get(_RUNS, None)) is not None:
        runs.close()


class _Runs:
    """The cases that were run in this process."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config
        self._results: dict[str, CaseResult | str] = {}
        self._solvers = tuple(config.getini("verify_solvers"))
        self._place: tempfile.TemporaryDirectory[str] | None = None

    @property
    def strict(self) -> bool:
        """Whether an UNDECIDED check fails."""
        return bool(self._config.getoption("verify_strict") or self._config.getini("verify_strict"))

    def result(self, source: str) -> "CaseResult":
        """Run a case once, and return its result; the second time a failure is only repeated."""
        from verify.errors import InputError

        if source not in self._results:
            try:
                self._results[source] = self._run(source)
            except InputError as error:
                self._results[source] = str(error)
        found = self._results[source]
        if isinstance(found, str):
            pytest.fail(found, pytrace=False)
        return found

    def check_names(self, source: str) -> list[str]:
        """Names of the checks of a case, one per solver; a case without any has one."""
        from verify.judge.checks import judged_by
        from verify.runner.plan import solvers_of
        from verify.scene import load_scene

        scene = load_scene(source)
        solvers = solvers_of(scene, self._options(scene))
        made = [
            (check.check, check.metric, solver)
            for check in scene.acceptance
            for solver in judged_by(check, solvers) or [""]
        ]
        return _names(made) or [_NO_CHECK]

    def verdict(self, source: str, name: str) -> "VerdictRecord | None":
        """Return the verdict on a check; None if the solver refuses the case."""
        verdicts = self.result(source).verdicts
        names = _names([(v.check, v.metric, v.solver) for v in verdicts])
        return dict(zip(names, verdicts, strict=True)).get(name)

    def _options(self, scene: "Scene") -> "Options":
        from verify.runner.fingerprint import cache_folder
        from verify.runner.selection import Options

        named = {name for c in scene.acceptance for name in (c.solver, c.compared)}
        # the default would run the conforming solver too, for the report that nobody reads here;
        # if more are named, the default takes them all and survives one that is not installed
        alone = ("xfem",) if named <= {"xfem", None} else ()
        bundle = self._config.getini("verify_references")
        return Options(
            solvers=self._solvers or alone,
            repetitions=1,
            timeout=float(self._config.getini("verify_timeout")),
            cache=cache_folder(),
            references=self._config.rootpath / bundle if bundle else None,
        )

    def _run(self, source: str) -> "CaseResult":
        from verify.runner.run import run_cases
        from verify.runner.selection import select_cases
        from verify.scene import load_scene

        scene = load_scene(source)
        folder = self._root() / scene.name.replace("/", "__")
        with_rows = select_cases([source])  # of the family, that it is compared with
        summary = run_cases(with_rows, folder, self._options(scene), _Silent(), "pytest")
        return next(one for one in summary.results if one.case == scene.name)

    def _root(self) -> Path:
        if kept := self._config.getoption("verify_out"):
            return self._config.invocation_params.dir / str(kept)
        if self._place is None:
            self._place = tempfile.TemporaryDirectory(prefix="verify-pytest-")
        return Path(self._place.name)

    def close(self) -> None:
        if self._place is not None:
            self._place.cleanup()


class _Silent:
    """Progress of a run that nobody watches."""

    def planned(self, solves: int, cases: int) -> None: ...

    def started(self, label: str) -> None: ...

    def solved(self, label: str, record: "SolveRecord", reused: bool) -> None: ...

    def judged(self, result: "CaseResult") -> None: ...


def _names(made: Iterable[tuple[str, str, str]]) -> list[str]:
    """Names of checks, distinct, in their order, from kind, metric and solver."""
    names: list[str] = []
    for name in map("-".join, made):
        twins = sum(other == name or other.startswith(f"{name}-#") for other in names)
        names.append(f"{name}-#{twins + 1}" if twins else name)
    return names


def _judge(item: pytest.Item, source: str, name: str) -> "VerdictRecord":
    """End the test unless the check passes."""
    from verify.result import Verdict

    runs = item.config.stash[_RUNS]
    if name == _NO_CHECK:
        pytest.skip("the case makes no acceptance check")
    record = runs.verdict(source, name)
    if record is None:
        pytest.skip(f"{name}: the solver refuses the case")
    observed = "not observed" if record.observed is None else f"{record.observed:.6g}"
    text = f"{record.verdict}: {record.metric} ({record.solver}): {observed}, "
    text += f"wanted {record.limit}: {record.reason}"
    if record.badge:
        text += f" [{record.badge}]"
        item.user_properties.append(("badge", record.badge))  # in JUnit, of a test that passes too
    if record.known:
        pytest.xfail(f"known finding: {record.known}: {text}")
    if record.verdict is Verdict.UNDECIDED and not runs.strict:
        pytest.skip(text)
    if record.verdict is not Verdict.PASS:
        pytest.fail(text, pytrace=False)
    return record


# ------------------------------------------------------------------------------- case files


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> "CaseFile | None":
    """Collect a case file."""
    if file_path.suffix != ".toml":
        return None
    config = parent.config
    try:
        below = file_path.relative_to(config.rootpath).as_posix()
    except ValueError:
        below = file_path.name
    named = any(fnmatch(below, pattern) for pattern in config.getini("verify_cases"))
    if named or fnmatch(file_path.name, _OWN_FILES):
        return CaseFile.from_parent(parent, path=file_path)
    return None


class CaseFile(pytest.File):
    """A case file; its tests are its acceptance checks, of each solver."""

    def collect(self) -> Iterator["CheckItem"]:
        """Yield a test per acceptance check and solver."""
        from verify.errors import InputError
        from verify.scene import load_scenes

        try:
            labels = [one.row.label if one.row else "" for one in load_scenes(self.path)]
            names = {r: self.config.stash[_RUNS].check_names(f"{self.path}{r}") for r in labels}
        except InputError as error:
            raise self.CollectError(str(error)) from None
        for row, checks in names.items():
            for check in checks:
                yield CheckItem.from_parent(self, name=f"{check}{row}", row=row, check=check)


class CheckItem(pytest.Item):
    """An acceptance check of a row of a case file, made of one solver."""

    def __init__(self, *, row: str, check: str, **given: Any) -> None:
        super().__init__(**given)
        self._row, self._check = row, check

    def runtest(self) -> None:
        """Run the case, if that is not done, and judge the check."""
        _judge(self, f"{self.path}{self._row}", self._check)

    def reportinfo(self) -> tuple[Path, None, str]:
        """Say which check of which file this is."""
        return self.path, None, f"{self.path.name}: {self.name}"


# -------------------------------------------------------------------------------- the marker


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Make one test per acceptance check and solver of a marked function."""
    marker = metafunc.definition.get_closest_marker("verify")
    if marker is None:
        return
    from verify.errors import InputError

    try:
        names = metafunc.config.stash[_RUNS].check_names(_case_of(marker))
    except (InputError, pytest.UsageError) as error:  # a line, without the way that led here
        said = f"{metafunc.definition.nodeid}: {error}"
        raise pytest.Collector.CollectError(said) from None
    if "verify_check" not in metafunc.fixturenames:
        metafunc.fixturenames.append("verify_check")
    metafunc.parametrize("verify_check", names, indirect=True)


def _case_of(marker: pytest.Mark) -> str:
    if len(marker.args) != 1 or marker.kwargs or not isinstance(marker.args[0], str | Path):
        raise pytest.UsageError('expected @pytest.mark.verify("case"), the name or file of a case')
    return str(marker.args[0])


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> None:
    """Judge the check before the body of a marked test."""
    marker = pyfuncitem.get_closest_marker("verify")
    if marker is not None:
        name: Any = pyfuncitem.callspec.params["verify_check"]
        record = _judge(pyfuncitem, _case_of(marker), name)
        pyfuncitem.funcargs["verify_check"] = record


@pytest.fixture
def verify_check(request: pytest.FixtureRequest) -> Any:
    """Give the verdict on the check of this test; it passed, or the body would not run."""
    return request.param  # the hook above puts the record here


@pytest.fixture
def verify_result(request: pytest.FixtureRequest) -> "CaseResult":
    """Give the whole result of the case of this test."""
    marker = request.node.get_closest_marker("verify")
    if marker is None:
        raise pytest.UsageError('verify_result belongs to tests marked @pytest.mark.verify("case")')
    return request.config.stash[_RUNS].result(_case_of(marker))
