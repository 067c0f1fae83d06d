"""Commands that look: cases, the answer of a case file, a finished run, the installation."""

import shutil
import sys
import textwrap
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from verify.cli.signatures import Arg, AsJson, Case, Matching, Run
from verify.cli.streams import print_answer, print_json
from verify.errors import InputError
from verify.printable import one_line

if TYPE_CHECKING:
    from verify.scene import Scene


_UNWRAPPED = 10_000  # columns where there is no terminal: one line per case, for grep
_AS_IT_IS: dict[str, Any] = {"break_long_words": False, "break_on_hyphens": False}


def list_(*, exact: bool = False, expression: Matching = None, as_json: AsJson = False) -> int:
    """List the cases, or the exact solutions.

    Parameters
    ----------
    exact
        list exact solutions instead

    Examples
    --------
      verify list
      verify list -k quick
      verify list --exact
      verify list --json
    """
    rows = _exact_solutions() if exact else _cases(expression)
    if as_json:
        print_json(rows, ensure_ascii=False)
        return 0
    if not rows:
        print("no case matches" if expression else "no cases")
        return 0
    width = max(len(row["name"]) for row in rows)
    columns = shutil.get_terminal_size((_UNWRAPPED, 1)).columns
    for row in rows:
        tags = f"  [{', '.join(row['tags'])}]" if row.get("tags") else ""
        line = f"{row['name']:<{width}}  {row['title']}{tags}"
        indent = " " * (width + 2 if columns >= 2 * width else 4)
        print("\n".join(textwrap.wrap(line, columns, subsequent_indent=indent, **_AS_IT_IS)))
    return 0


def _cases(expression: str | None) -> list[dict[str, Any]]:
    """Return a row per case; a case file that is broken is listed with its fault."""
    from verify.runner.selection import parse_expression
    from verify.scene import list_cases, load_scenes

    wanted = parse_expression(expression) if expression is not None else None
    rows: list[dict[str, Any]] = []
    for name, path in list_cases().items():
        try:
            scenes = load_scenes(path)
        except InputError as error:
            rows.append({"name": name, "title": f"BROKEN: {error}", "tags": []})
            continue
        rows += [
            {
                "name": scene.name,
                "title": scene.title,
                "requirement": scene.requirement,
                "tags": scene.tags,
                "levels": scene.mesh.count,
                "dimension": scene.dimension,
                "file": str(path),
            }
            for scene in scenes
            if wanted is None or wanted(scene)
        ]
    return rows


def _exact_solutions() -> list[dict[str, Any]]:
    from reference.exact import exact_solution_names

    return [{"name": name, "title": text} for name, text in exact_solution_names().items()]


def describe(case: Case, *, as_json: Annotated[bool, Arg(flags=("--json",))] = False) -> int:
    """Say in words what a case asks.

    Parameters
    ----------
    as_json
        print the case with all defaults

    Examples
    --------
      verify describe statics/f1_patch
      verify describe my_case.toml
    """
    from verify.scene import load_scene

    scene = load_scene(case)
    answer = scene.model_dump(mode="json", by_alias=True)
    return print_answer(as_json, answer, [_description(scene)])


def _description(scene: "Scene") -> str:
    """Return the case in words: requirement, body, cuts, supports, loads, checks."""
    from verify.scene import scene_hash

    parts: list[tuple[str, list[str]]] = [
        ("tags", [", ".join(scene.tags)] if scene.tags else []),
        ("body", [_keys(scene.geometry), *filter(None, _size(scene))]),
        ("material", [_keys(scene.material)]),
        ("mesh", [_mesh(scene)]),
        ("cuts", [f"{cut.name}: {_keys(cut, 'name', 'opens_at')}" for cut in scene.cuts]),
        ("supports", [_keys(support) for support in scene.supports]),
        ("loads", [_keys(load) for load in scene.loads]),
        ("analysis", [_keys(scene.analysis, "damping")]),
        ("initially", [_keys(scene.initial)] if scene.analysis.kind == "dynamic" else []),
        ("measured", [_keys(quantity) for quantity in scene.quantities]),
        ("judged by", [_judge(scene)]),
        ("accepted if", [_demand(check) for check in scene.acceptance] or ["nothing is judged"]),
        ("known", [_known(finding) for finding in scene.known_findings]),
        ("hash", [scene_hash(scene)]),
    ]
    lines = [scene.name, scene.title, "", textwrap.fill(scene.requirement, 92), ""]
    for name, entries in parts:
        for head, entry in zip([name, *[""] * len(entries)], entries, strict=False):
            lines.append(
                textwrap.fill(entry, 92, initial_indent=f"{head:<12}", subsequent_indent=" " * 14)
            )
    return "\n".join(lines)


def _known(finding: Any) -> str:
    return f"{finding.check} of {finding.metric} fails with {finding.solver}: {finding.reason}"


def _size(scene: "Scene") -> list[str]:
    from verify.runner.cost import body_text

    try:
        if scene.geometry.kind != "file":
            return [body_text(scene)]
        from verify.runner.mesh_faults import body_notes  # loads what looks for neighbours

        return [body_text(scene), *body_notes(scene)]
    except (InputError, OSError) as error:  # a case is described without its mesh file, too
        return [str(error)]


def _demand(check: Any) -> str:
    """Say an acceptance check as the end of "accepted if …"."""
    what = f"{check.metric} of {check.solver or 'each solver'}"
    match check.check:
        case "value":
            within = f"within {check.relative_tolerance:g} relative"
            return f"{what} is {check.equals:.10g} {within} ({check.source})"
        case "error":
            return f"error in {what} is at most {check.at_most:g} on the finest mesh"
        case "rate" if check.equals is not None:
            return f"order of {what} is {check.equals:g} within {check.within:g}"
        case "rate":
            return f"order of {what} is at least {check.at_least:g}"
        case "ratio" if check.within is not None:
            return f"{what} over {_other(check)} is 1 within {check.within:g} on every mesh"
        case "ratio":
            return f"{what} over {_other(check)} is at most {check.at_most:g} on every mesh"
    return _keys(check)


def _other(check: Any) -> str:
    return f"that of {check.to if check.row is None else f'the row {check.row:g}'}"


def _keys(part: Any, *without: str) -> str:
    said = part.model_dump(mode="json", by_alias=True, exclude_none=True, exclude=set(without))
    head = said.pop("kind", said.pop("check", ""))
    stated = {key: value for key, value in said.items() if value not in ({}, [])}
    body = ", ".join(f"{key} {_value(value)}" for key, value in stated.items())
    return f"{head}{': ' if head and body else ''}{body}"


def _value(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, list):
        shown = value if len(value) <= 8 else [*value[:3], "…", value[-1]]
        return f"({', '.join(_value(entry) for entry in shown)})"
    return str(value)


def _mesh(scene: "Scene") -> str:
    if scene.mesh.pattern == "given":
        fine = f", {scene.mesh.count} levels by uniform refinement" if scene.mesh.refine else ""
        return f"as given{fine}"
    levels = [_value(list(level)) for level in scene.mesh.cells or []]
    levels += [f"h = {size:g} m" for size in scene.mesh.sizes or []]
    return f"{scene.mesh.pattern}, {scene.mesh.count} levels: {', '.join(levels)}"


def _judge(scene: "Scene") -> str:
    if scene.judged_by_exact and scene.exact is not None:
        return f"exact solution '{scene.exact.solution}'"
    levels = scene.reference
    return f"conforming reference, P{levels.degree}, {levels.levels} levels, with its uncertainty"


def check(files: Annotated[Sequence[str], Arg("FILE")], *, as_json: AsJson = False) -> int:
    """Validate case files without running them.

    Parameters
    ----------
    files
        case file

    Examples
    --------
      verify check my_case.toml
      verify check cases/*/*.toml
    """
    from verify.cli.run_text import case_lines, memory_line
    from verify.runner.cost import LevelCost
    from verify.runner.fingerprint import cache_folder

    rows = [_checked(file) for file in files]
    if as_json:
        print_json(rows)
    else:
        for row in rows:
            if row["error"]:
                print(f"verify: error: {row['error']}", file=sys.stderr)
            else:
                print(f"{row['file']}: ok ({row['title']})")
                if row["body"]:
                    print(f"  body: {row['body']}")
                for note in row["notes"]:
                    print(f"    {note}")
                costs = [LevelCost(**one) for one in row["cost"]]
                for line in case_lines(costs):
                    print(f"  {line}")
                for warning in filter(None, [memory_line(costs), *row["warnings"]]):
                    print(f"verify: {row['file']}: warning: {warning}", file=sys.stderr)
    if not as_json and not cache_folder().exists():  # nothing was ever run here
        print("which suite first: `verify run -k demo` (a minute) shows that all works here")
    return 2 if any(row["error"] for row in rows) else 0


def _checked(file: str) -> dict[str, Any]:
    """Return the checks of a file as plain values."""
    from verify.cli.run_text import costs_of
    from verify.runner.checking import check_scene
    from verify.runner.cost import body_text
    from verify.runner.fingerprint import cache_folder
    from verify.runner.mesh_faults import body_notes, mesh_warnings
    from verify.runner.selection import Options
    from verify.scene import load_scenes

    try:
        scenes = load_scenes(file)
        for scene in scenes:
            check_scene(scene)
    except InputError as error:
        blank = {"body": "", "notes": [], "warnings": [], "cost": []}
        return {"file": file, "title": None, "error": one_line(error), **blank}
    rows = f" and {len(scenes) - 1} more rows" if len(scenes) > 1 else ""
    options = Options(cache=cache_folder())
    return {
        "file": file,
        "title": f"{scenes[0].title}{rows}",
        "error": None,
        "body": body_text(scenes[0]),
        "notes": body_notes(scenes[0]),
        "warnings": mesh_warnings(scenes[0]),
        "cost": [asdict(one) for scene in scenes for one in costs_of(scene, options)],
    }


def schema() -> int:
    """Print the JSON Schema of a case file, for editors.

    Examples
    --------
      verify schema > case.schema.json
    """
    from verify.scene import scene_schema

    print_json(scene_schema(), ensure_ascii=False)
    return 0


def report(
    directory: Annotated[Path, Arg("DIR")],
    *,
    form: Annotated[
        Literal["html", "markdown", "summary", "pdf"], Arg(flags=("--format",))
    ] = "html",
) -> int:
    """Render the report of a run or of studies again, without computing anything.

    Parameters
    ----------
    directory
        directory of a run or of studies
    form
        a page (default); Markdown with pictures beside it; or PDF, which needs Chromium

    Examples
    --------
      verify report out
      verify report out --format markdown
    """
    from verify.cli.progress import waiting_reported
    from verify.report.rendering import render
    from verify.report.study_page import render_study, studies_in

    if (directory / "run.json").is_file():
        with waiting_reported(sys.stderr, f"the report of {directory}"):
            page = render(directory, form)
        print(f"report: {page}")
        return 0
    if not (kinds := studies_in(directory)):
        raise InputError("not a run (it has no run.json) nor that of a study", str(directory))
    for kind in kinds:
        page = render_study(directory, kind, "markdown" if form == "summary" else form)
        print(f"report: {page}")
    return 0


def paraview(
    run: Run,
    *,
    out: Annotated[Path | None, Arg("DIR")] = None,
    solvers: Annotated[Sequence[str], Arg("NAME", ("--solver",))] = (),
    level: Annotated[int | None, Arg("K")] = None,
    reference: bool = False,
    as_json: Annotated[bool, Arg(flags=("--json",))] = False,
) -> int:
    """Write the solutions of a run for ParaView: displacement, strain, stress over time.

    Parameters
    ----------
    out
        directory to write into (default: the folder paraview in the run)
    solvers
        only of this solver; repeat for several (default: all, and the reference)
    level
        mesh level, 0 is the coarsest (default: the finest of each solver)
    reference
        add the displacement of the reference and the error against it
    as_json
        print the files as JSON

    Examples
    --------
      verify paraview out
      verify paraview out --solver xfem --level 0 --reference --out fields

    Open the .pvd files; Warp By Vector with `displacement` shows the deformed body.
    """  # fmt: skip
    from verify.exchange import export_fields

    files = export_fields(run, out or run / "paraview", solvers, level, reference)
    names = [str(file) for file in files]
    return print_answer(as_json, {"files": names}, names)


def doctor(
    *, compiling: Annotated[bool, Arg(flags=("--compile",))] = False, as_json: AsJson = False
) -> int:
    """Say what of the software that the solvers stand on is here, works, or is missing.

    Parameters
    ----------
    compiling
        compile all kernels now, in two processes, and say what each module took

    Examples
    --------
      verify doctor
      verify doctor --compile

    Exit code 0 if everything that a full run needs works, 3 if something is missing; each
    missing thing comes with the line that installs it.
    """
    if compiling:
        return _compile(as_json)
    from verify.doctor import examine

    findings = examine()
    code = 3 if any(finding.needed and not finding.works for finding in findings) else 0
    width, lines = max(len(finding.name) for finding in findings), []
    for finding in findings:
        mark = "ok     " if finding.works else "MISSING" if finding.needed else "absent "
        lines.append(f"{mark}  {finding.name:<{width}}  {finding.found}")
        if finding.cure and not finding.works:
            lines.append(f"         {'':<{width}}  → {finding.cure}")
    return print_answer(as_json, [finding.as_json() for finding in findings], lines, code)


def _compile(as_json: bool) -> int:
    from verify.first_use import FirstUseError, compile_all

    try:
        use = compile_all()
    except FirstUseError as error:
        print(f"verify: error: {error}", file=sys.stderr)
        return 3
    whole = sum(use.seconds.values())
    lines = [f"{use.kernels} compilations in {use.wall:.1f} s, {whole:.1f} s of processor time"]
    lines += ["\nseconds  module"] if whole > 0.0 else []
    by_module = Counter[str]()  # seconds
    for kernel, spent in use.seconds.items():
        by_module[kernel.partition(":")[0]] += spent  # type: ignore[assignment]
    lines += [
        f"{seconds:7.1f}  {name}" for name, seconds in by_module.most_common() if seconds >= 0.05
    ]
    return print_answer(as_json, asdict(use), lines)
