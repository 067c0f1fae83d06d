"""Several runs that use one cache at the same time: what is taken is whole and right."""

import multiprocessing
import random

from fake_solvers import Instant

from verify.result import Status
from verify.runner.job import Job
from verify.runner.reference_cache import ReferenceCache
from verify.scene import load_scene
from verify.solution import read_solution, write_solution

LEVELS = 3


def use(seed, place, rounds, report):
    """Keep, take, damage and remove entries in any order; say what was taken and wrong."""
    chance = random.Random(seed)
    scene = load_scene(place / "square.toml")
    cache = ReferenceCache(place / "cache")
    taken, wrong = 0, []
    for k in range(rounds):
        level = chance.randrange(LEVELS)
        job = Job("square", "reference", level, 1, "any", place / f"solve-{level}")
        match chance.choice((*3 * ["keep"], *6 * ["take"], "damage", "remove")):
            case "keep":
                if said := cache.keep(scene, job, job.blank(Status.SOLVED, "")):
                    wrong.append(said)
            case "take":
                folder = place / f"taken-{seed}-{k}"
                folder.mkdir()
                own = Job("square", "reference", level, 1, "any", folder)
                if cache.take(scene, own) is not None:
                    taken += 1
                    points = len(read_solution(folder / "solution").points)
                    if points != ((2 << level) + 1) ** 2:
                        wrong.append(f"level {level} has {points} points")
            case "damage":
                for file in (cache.root).glob("[!.]*/solution.vtu"):
                    try:
                        text = file.read_bytes()
                        file.write_bytes(text[: len(text) // 2])
                    except OSError:  # removed meanwhile
                        continue
                    break
            case "remove":
                cache.remove(cache.entries()[:1])
    report.put((taken, wrong))


def test_runs_that_share_a_cache_never_take_half_an_entry(tmp_path, case_text, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    (tmp_path / "square.toml").write_text(case_text + '[reference]\nkind = "conforming"\n')
    for level in range(LEVELS):
        (tmp_path / f"solve-{level}").mkdir()
        write_solution(Instant().field(2 << level, 1), tmp_path / f"solve-{level}" / "solution")
    context = multiprocessing.get_context("spawn")
    report = context.Queue()
    users = [context.Process(target=use, args=(seed, tmp_path, 40, report)) for seed in range(3)]
    for user in users:
        user.start()
    said = [report.get(timeout=100) for _ in users]
    for user in users:
        user.join()
    assert [wrong for _, wrong in said if wrong] == []
    assert sum(taken for taken, _ in said) > 0
    cache = ReferenceCache(tmp_path / "cache")
    assert not list(cache.root.glob(".partial-*"))
    cache.remove_damaged()
    for entry in cache.entries():
        assert entry.files.keys() == {"solution.json", "solution.vtu"}
