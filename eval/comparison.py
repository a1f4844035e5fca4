"""Play every run and the zero action of every layer under the same conditions, and count."""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from eval import statistics as st
from eval.clips import Shown, fate
from eval.comparable import check_comparable, group, shared_settings
from eval.page.colours import colours_of
from eval.results import Band, Comparison, Crossing, Layer, Pair, RunResult, Settings
from eval.rollout import Player, filmed, play_player
from eval.statistics import Chance
from eval.wording import number
from train.episodes import METRICS, Episodes
from train.runs.command_line import command_again
from train.runs.reading import Run

Say = Callable[[str], None]


@dataclass(frozen=True)
class Clips:
    """One clip per layer, all under the same pushes."""

    shown: list[Shown]
    push: float  # size of the pushes, N; 0 where nobody was pushed with a force in the episodes
    same_pushes: bool  # whether all layers did meet the same, as far as their episodes lasted


def compare(runs: Sequence[Run], settings: Settings, say: Say = lambda text: None) -> Comparison:
    """Play every run and the zero action of every layer, and gather the statistics.

    Raises:
        RunError: runs that cannot be compared.
    """
    warnings = check_comparable(runs)
    chance = Chance(np.random.default_rng(settings.seed), settings.samples, settings.confidence)
    groups = group(runs)
    played: dict[Path, Episodes] = {}
    for run in runs:
        say(f"{run.layer}: {run.path.name}")
        played[run.path] = play_player(Player.of(run), settings.episodes, settings.seed)
        warnings += _changed(run, played[run.path])
    strongest = max(float(episodes.strongest_push.max()) for episodes in played.values())
    hardest = _round_up(strongest)
    sweep = [share * hardest for share in settings.sweep] if hardest > 0 else []
    threshold = settings.threshold
    if threshold is None:
        threshold = _default_threshold(groups, settings)
    layers = []
    for name, members in groups.items():
        say(f"{name}: zero action")
        zero = Player.of(members[0], trained=False)
        zero_action = _means(play_player(zero, settings.episodes, settings.seed))
        if sweep:
            say(f"{name}: pushes of up to {max(sweep):.0f} N")
        results = [
            _result(run, played[run.path], _survival(Player.of(run), sweep, settings))
            for run in members
        ]
        layers.append(
            Layer(
                name=name,
                env_args=dict(members[0].policy.env_args),
                runs=results,
                metrics={
                    m.name: st.estimate(np.array([run.metrics[m.name] for run in results]), chance)
                    for m in METRICS
                },
                zero_action=zero_action,
                by_steps=_band(results, "steps", chance),
                by_wall=_band(results, "wall", chance),
                steps_to=_crossing(results, "steps", threshold, chance),
                wall_to=_crossing(results, "wall", threshold, chance),
                sweep=[
                    st.estimate(np.array([run.sweep[k] for run in results]), chance)
                    for k in range(len(sweep))
                ],
                zero_sweep=_survival(zero, sweep, settings),
            )
        )
    layers.sort(key=lambda layer: -layer.metrics["returned"].value)
    versions = next((run.versions for run in runs if run.config is not None), runs[0].versions)
    return Comparison(
        env_id=runs[0].policy.env_id,
        env_args=runs[0].env_args,
        settings=settings,
        layers=layers,
        pairs=[_pair(*two, chance) for two in itertools.combinations(layers, 2)],
        threshold=threshold,
        hardest_push=hardest,
        sweep=sweep,
        warnings=warnings,
        shared=shared_settings(runs),
        versions=versions,
    )


def _changed(run: Run, episodes: Episodes) -> list[str]:
    """Warn if fresh episodes do not return what the last evaluation of the same policy did."""
    if run.curve is None:
        return []
    last, now = float(run.curve.returns[-1]), float(episodes.returned.mean())
    error = math.hypot(
        float(run.curve.spread[-1]) / math.sqrt(run.curve.episodes[-1]),
        float(episodes.returned.std()) / math.sqrt(len(episodes)),
    )
    if abs(now - last) <= 5.0 * error + 0.01 * abs(last):
        return []
    return [
        f"{run.path.name} returns {number(now)} now and {number(last)} at its last evaluation in "
        "training: the environment, or the policy, is not what it was."
    ]


def _round_up(value: float) -> float:
    """Round up to two significant digits: pushes drawn up to 100 N reach 99.7 N."""
    if value <= 0:
        return 0.0
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / unit - 1e-9) * unit


def _default_threshold(groups: Mapping[str, Sequence[Run]], settings: Settings) -> float | None:
    curves = [
        np.array([(run.curve.returns[0], run.curve.returns[-1]) for run in members if run.curve])
        for members in groups.values()
        if all(run.curve is not None for run in members)
    ]
    if not curves:
        return None
    ends = [st.interquartile_mean(values) for values in curves]
    start, finish = min(first for first, _ in ends), max(last for _, last in ends)
    return float(start + settings.threshold_share * (finish - start))


def _result(run: Run, episodes: Episodes, sweep: list[float]) -> RunResult:
    curve = run.curve
    return RunResult(
        name=run.path.name,
        path=str(run.path),
        seed=run.seed,
        trained_steps=run.policy.trained_steps,
        wall_seconds=None if curve is None else float(curve.wall_seconds[-1]),
        metrics=_means(episodes),
        steps=[] if curve is None else curve.steps.tolist(),
        wall=[] if curve is None else curve.wall_seconds.tolist(),
        returns=[] if curve is None else curve.returns.tolist(),
        sweep=sweep,
        command="" if run.config is None else command_again(run.config, run.path),
    )


def _means(episodes: Episodes) -> dict[str, float]:
    return {metric.name: float(np.mean(getattr(episodes, metric.name))) for metric in METRICS}


def _survival(player: Player, pushes: Sequence[float], settings: Settings) -> list[float]:
    """Share of episodes survived under pushes of each size, all else as in training."""
    shares = []
    for push in pushes:
        changes = {"push_force": [push, push], "episode_seconds": settings.sweep_seconds}
        pushed = replace(player, env_args={**player.env_args, **changes})
        episodes = play_player(pushed, settings.sweep_episodes, settings.seed)
        shares.append(float(np.mean(episodes.survived)))
    return shares


def _band(runs: Sequence[RunResult], axis: str, chance: Chance) -> Band | None:
    if not all(run.returns for run in runs):
        return None
    return st.band([getattr(run, axis) for run in runs], [run.returns for run in runs], chance)


def _crossing(
    runs: Sequence[RunResult], axis: str, threshold: float | None, chance: Chance
) -> Crossing | None:
    if threshold is None or not all(run.returns for run in runs):
        return None
    each = [st.first_crossing(getattr(run, axis), run.returns, threshold) for run in runs]
    return st.crossing(np.array(each), chance)


def _pair(one: Layer, other: Layer, chance: Chance) -> Pair:
    x, y = one.values("returned"), other.values("returned")
    probability, apart = st.improvement([x], [y], chance), st.difference(x, y, chance)
    return Pair(one.name, other.name, probability, apart, st.p_value(x, y, chance.rng))


def film(runs: Sequence[Run], comparison: Comparison, say: Say = lambda text: None) -> Clips:
    """Record the median run of each layer of a comparison, all under the same pushes."""
    settings = comparison.settings
    push = settings.video_push * comparison.hardest_push
    # Who was never pushed may be of an environment that knows no such argument.
    changes: dict[str, Any] = {"push_force": [push, push]} if comparison.hardest_push > 0 else {}
    shown, colours = list[Shown](), colours_of(layer.name for layer in comparison.layers)
    for layer in comparison.layers:
        ranked = sorted(layer.runs, key=lambda run: run.metrics["returned"])
        chosen = ranked[(len(ranked) - 1) // 2]
        say(f"{layer.name}: clip of {chosen.name}")
        run = next(run for run in runs if str(run.path) == chosen.path)
        player = Player.of(run, **changes)
        clip = filmed(player, settings.seed, settings.video_seconds, "")
        note = fate(clip) if chosen.seed is None else f"seed {chosen.seed}, {fate(clip)}"
        shown.append(Shown(layer.name, colours[layer.name], note, clip))
    traces = [one.clip.pushes for one in shown]
    common = min(len(trace) for trace in traces)
    same = all(np.array_equal(trace[:common], traces[0][:common]) for trace in traces)
    # An episode may reach its time limit before the clip is over; a fallen robot's clip never does.
    shortest = min(len(one.clip.frames) for one in shown)
    cut = [one._replace(clip=replace(one.clip, frames=one.clip.frames[:shortest])) for one in shown]
    return Clips(cut, push, same)
