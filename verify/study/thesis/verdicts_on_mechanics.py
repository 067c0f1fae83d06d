"""Verdicts on stability, accuracy, and on what goes wrong where."""

from collections.abc import Iterator, Sequence

from verify.result import Verdict
from verify.simulator.thesis.added_nodes import FaceCount
from verify.study.record import Finding
from verify.study.thesis.measured import Measured
from verify.study.thesis.methods_compared import MethodOnCase
from verify.study.thesis.sliver_systems import SliverSystem, exponent

_FLAT, _KEPT = 0.02, 0.9  # exponent of a step that slivers leave alone; share of the uncut one
_AS_GOOD = 1.05
_TIPS = 3.0
# L² and energy norm against a conforming mesh: what the cases themselves demand (squared in L²)
_LIMITS = {
    "statics/griffith_inside": (_TIPS, _TIPS),
    "statics/tissue_strip": (1.25**2, 1.25),
    "statics/buried_cut": (_TIPS, _TIPS),
}
_TIP_CASE = "griffith_inside"


def verdicts_on_mechanics(measured: Measured) -> list[Finding]:
    """Judge slivers, accuracy and limits."""
    return [
        *_slivers(measured.slivers),
        _face(measured.face[-1]),
        *_accuracy(measured.methods),
        *_wrong(measured.methods),
        *_small([row for row in measured.slivers if row.method == "xfem"]),
    ]


def _slivers(steps: Sequence[SliverSystem]) -> Iterator[Finding]:
    for method in dict.fromkeys(step.method for step in steps):
        own = [step for step in steps if step.method == method]
        slopes = {
            dim: exponent([step for step in own if step.dimension == dim])
            for dim in dict.fromkeys(step.dimension for step in own)
        }
        least = min(step.ratio for step in own)
        exponents = ", ".join(f"{slope:.2f} ({dim}D)" for dim, slope in slopes.items())
        yield Finding(
            f"stable: explicit step with slivers, {method}",
            f"over ε from {max(s.size for s in own):g} to {min(s.size for s in own):g} the "
            f"critical step is at least {least:.3g} of that of the uncut body, with exponents "
            f"{exponents}",
            f"at least {_KEPT} of the uncut step, exponent within {_FLAT} of 0",
            Verdict.PASS
            if least >= _KEPT and all(abs(slope) <= _FLAT for slope in slopes.values())
            else Verdict.FAIL,
        )


def _face(row: FaceCount) -> Finding:
    said = ", ".join(
        f"{name} {step:.2g} ({row.smallest[name]:.1e})" for name, step in row.step.items()
    )
    divided = [step for name, step in row.step.items() if "subdivision" in name]
    kept = row.step["xfem"] >= _KEPT and row.step["xfem"] > max(divided)
    return Finding(
        "stable: no slivers in the face",
        f"{row.cuts} cut elements, critical explicit step over that of the uncut face (smallest "
        f"element or piece over its element): {said}",
        f"XFEM at least {_KEPT}, and more than whatever divides elements",
        Verdict.PASS if kept else Verdict.FAIL,
    )


def _finest(methods: Sequence[MethodOnCase], case: str) -> dict[str, MethodOnCase]:
    """By solver, on the finest level that both XFEM and the conforming solver were compared on."""
    own = [row for row in methods if row.case == case and row.displacement is not None]
    levels = [{r.level for r in own if r.solver == name} for name in ("xfem", "conforming")]
    common = levels[0] & levels[1]
    return {row.solver: row for row in own if common and row.level == max(common)}


def _accuracy(methods: Sequence[MethodOnCase]) -> Iterator[Finding]:
    for case in dict.fromkeys(row.case for row in methods):
        finest = _finest(methods, case)
        if not finest:
            yield Finding(
                f"accuracy: {case}", "XFEM and the conforming solver were not both compared",
                "a comparison", Verdict.UNDECIDED,
            )  # fmt: skip
            continue
        limits = _LIMITS.get(case, (_AS_GOOD, _AS_GOOD))
        words, ratios = [], []
        for limit, title, quantity in zip(
            limits, ("L²", "energy norm"), ("displacement", "energy_norm"), strict=True
        ):
            one = getattr(finest["xfem"], quantity)
            other = getattr(finest["conforming"], quantity)
            if one is None or other is None:
                continue
            # the ratio of any two values in the intervals
            low, high = one[1] / other[2], one[2] / max(other[1], 1e-300)
            ratios.append((low / limit, high / limit))
            words.append(f"{title} {one[0]:.3g} against {other[0]:.3g}")
        kept = bool(ratios) and all(high <= 1.0 for _, high in ratios)
        broken = any(low > 1.0 for low, _ in ratios)
        verdict = Verdict.PASS if kept else Verdict.FAIL if broken else Verdict.UNDECIDED
        steps = {r.solver: r.critical_step for r in finest.values() if r.critical_step}
        said = ", ".join(f"{name} {step:.2g}" for name, step in steps.items())
        yield Finding(
            f"accuracy: {case}",
            f"relative errors of XFEM against those of a conforming mesh of the same size, level "
            f"{finest['xfem'].level}: {'; '.join(words) or 'none measured'}. "
            f"Critical steps over that of the uncut mesh: {said}",
            f"at most {limits[0]:g} (L²) and {limits[1]:g} times (energy norm) the conforming one",
            verdict,
        )


def _wrong(methods: Sequence[MethodOnCase]) -> Iterator[Finding]:
    for case in dict.fromkeys(row.case for row in methods):
        finest = _finest(methods, case)
        if not finest or "xfem" not in finest:
            continue
        own = finest["xfem"].displacement
        assert own is not None
        others = {n: r.displacement[0] / own[0] for n, r in finest.items() if r.displacement}
        good = [name for name, ratio in others.items() if ratio <= _TIPS]
        bad = {name: ratio for name, ratio in others.items() if ratio > _TIPS}
        yield Finding(
            f"what goes wrong: methods on {case}",
            f"within {_TIPS:g} times XFEM's error: {', '.join(good)}; worse: "
            + (", ".join(f"{name} {ratio:.0f} times" for name, ratio in bad.items()) or "none"),
            f"every method within {_TIPS:g} times",
            Verdict.FAIL if bad else Verdict.PASS,
        )
        if _TIP_CASE in case:
            yield from _tips(methods, case)


def _tips(methods: Sequence[MethodOnCase], case: str) -> Iterator[Finding]:
    rows = {
        name: {
            row.level: row
            for row in methods
            if row.case == case and row.solver == name and row.displacement is not None
        }
        for name in ("xfem", "conforming")
    }
    levels = sorted(set(rows["xfem"]) & set(rows["conforming"]))
    ratios = [
        rows["xfem"][k].displacement[0] / rows["conforming"][k].displacement[0]  # type: ignore[index]
        for k in levels
    ]
    if not ratios:
        return
    yield Finding(
        "what goes wrong: tips inside elements",
        "without tip enrichment an incision ends on an edge of the element. Its error is "
        + ", ".join(f"{ratio:.2f}" for ratio in ratios)
        + " times that of a conforming mesh whose node is the tip, from coarse to fine; "
        f"{rows['xfem'][levels[0]].changed or 'nothing else changed'}",
        f"at most {_AS_GOOD:g} times",
        Verdict.PASS if max(ratios) <= _AS_GOOD else Verdict.FAIL,
    )


def _small(pieces: Sequence[SliverSystem]) -> Iterator[Finding]:
    for dim in dict.fromkeys(row.dimension for row in pieces):
        own = sorted((row for row in pieces if row.dimension == dim), key=lambda row: -row.size)
        first, last = own[0], own[-1]
        yield Finding(
            f"what goes wrong: small pieces, {dim}D",
            f"from ε = {first.size:g} to {last.size:g} the condition number of XFEM's stiffness "
            f"goes from {first.condition:.1e} to {last.condition:.1e}; scaled by its diagonal it "
            f"goes from {first.scaled:.0f} to {last.scaled:.0f}",
            "condition number after scaling less than twice that at the first ε",
            Verdict.PASS if last.scaled <= 2.0 * first.scaled else Verdict.FAIL,
        )
