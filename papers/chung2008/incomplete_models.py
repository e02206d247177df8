"""Does an incomplete model degrade control? chung2008 says it may; here computed torque tries."""

import numpy as np

from caster_gym.agents.control.computed_torque import gains
from caster_gym.arrays import Array
from caster_gym.tasks.track.metrics import METRICS
from papers.chung2008.model_figures import picture
from papers.chung2008.model_trials import (
    BARE,
    EXACT,
    FINE_PERIOD,
    FREQUENCIES,
    HELD,
    LONGEST,
    MODELS,
    PATHS,
    PERIOD,
    PRINTED,
    RESERVE,
    RUNGS,
    SOFT,
    STARTS,
    STIFF,
    Study,
    exponents,
    study,
)
from papers.page import Check, Difference, Section, Table

WORSE = 2.0  # times the error count as degraded
EQUAL = 1.1  # times the error count as the same


def section() -> Section:
    """What computed torque loses with an incomplete model, by speed, feedback, path and robot."""
    studies = [study(name) for name in LONGEST]
    return Section(
        "Does an incomplete model degrade control?",
        _text(studies),
        _checks(studies),
        _tables(studies),
        (picture(studies),),
        (_difference(studies[0]),),
    )


def _text(studies: list[Study]) -> str:
    own, other = studies
    turned = own.heading[:, SOFT, 0, -1]
    effort = max(float(np.abs(s.effort[1:] / s.effort[EXACT] - 1.0).max()) for s in studies)
    distance = [s.apart[1:] / s.predicted[1:] for s in studies]
    soft, stiff = (np.stack([exponents(s.apart[1:, q], s.speeds) for s in studies]) for q in (SOFT, STIFF))
    hold = [exponents(s.position[EXACT], s.speeds) for s in studies]
    beside = own.position[EXACT] / own.apart[PRINTED]
    ratio = gains(FREQUENCIES[STIFF], PERIOD).stiffness / gains(FREQUENCIES[SOFT], PERIOD).stiffness
    stiffer = np.log(own.apart[1:, SOFT] / own.apart[1:, STIFF]) / np.log(ratio)
    least = min(float((s.position[BARE] / s.position[EXACT]).min()) for s in studies)
    return f"""
The paper compares the forces of the model with and without wheels (Figs. 8 and 9) and concludes that the incomplete
model "may deteriorate the required control performance of some dynamic model-based control algorithms"; it never closes
the loop. Here computed torque does so with three models, all else being equal: the **exact** one, the one **without
D1**, as the paper prints it (erratum E3), and the one **without wheels** (wheels, links and rotors have no mass). All
drive the same timed motions in the exact simulation, with the heading of (61) on the circle and the ellipse, from
{own.durations[0, 0]:g} s (the paper's time for its circle) to the shortest time that leaves the motors
{1.0 - RESERVE:.0%} in reserve. Torques are held for {1e3 * PERIOD:g} ms; starts are on the reference, casters trailing.
Of all torques {max(s.saturation for s in studies):.0%} reach a limit.

**The law.** The controller's force M̂ (ν̇ + k_d ė + k_p e) + ĥ moves a robot of M and h, so that

$$M\\ddot e + \\hat M(k_d\\dot e + k_p e) = \\Delta, \\qquad \\Delta = (M - \\hat M)\\dot\\nu + h - \\hat h,$$

and an error that changes slowly is $e = \\hat M^{{-1}}\\Delta / k_p$: it is the *known* inertia that divides. Δ grows
with the square of the speed, for (D1) and for the wheels alike, and k_p with that of the bandwidth. What the model
alone does is the distance between two robots whose controllers differ in nothing else. It grows with the power
{_span(stiff)} of the speed under stiff feedback, and {_span(soft)} under soft feedback, which is too slow for the
fastest motions; on {own.robot} it falls with the power {_span(stiffer)} of k_p. Integrated along the reference, without
simulating the robot, the law predicts this distance on {own.robot} within {np.abs(distance[0] - 1.0).max():.1%} in
every case, and on {other.robot} without D1 within {np.abs(distance[1][PRINTED - 1] - 1.0).max():.1%}. On {other.robot}
without wheels it is {_span(distance[1][BARE - 1])} times the prediction: M⁻¹M̂ has eigenvalues of
{other.grip[0]:.2f} … {other.grip[1]:.2f} ({own.grip[0]:.2f} … {own.grip[1]:.2f} on {own.robot}), the feedback is weaker
by as much, and so every other error grows as well; that of compensating dry friction with held torques is not small.

**What the exact model leaves.** Torques are held while casters turn. On {own.robot} this error grows with the power
{_span(hold[0])} of the speed (dry friction makes that {_span(hold[1])} on {other.robot}) and, times k_p, with the power
{_span(np.stack([_order(s) for s in studies]))} of the period. On {own.robot} it is {_span(beside[..., 0])} of what the
lack of (D1) does at the lowest speed, and {_span(beside[..., -1])} at the highest.

**The answer.** In proportion the claim holds: without wheels the position RMSE is at least {least:.1f} times that of
the exact model, whatever the robot, path, speed and feedback. In size it depends on speed and feedback. On the paper's
own motion, at {own.speeds[0, 0]:.2f} m/s, the error goes {_change(own, BARE, 0)}; at {own.speeds[0, -1]:.2f} m/s
{_change(own, BARE, -1)}, and the RMSE of the heading from {1e3 * turned[EXACT]:.2g} to {1e3 * turned[BARE]:.2g} mrad
at {FREQUENCIES[SOFT]:g} rad/s. The effort is that of the exact model within {effort:.0%}. The wheels have to be in
the model where the feedback must stay soft (noise, delay, contact) and the robot is fast.
"""


def _checks(studies: list[Study]) -> tuple[Check, ...]:
    own = studies[0]
    checks = [
        Check(
            f"performance of computed torque without wheels, {s.robot}, all paths, speeds and bandwidths",
            "“incomplete dynamic model neglecting wheel dynamics may deteriorate the required control performance”",
            f"position RMSE {_span(s.position[BARE] / s.position[EXACT], 1)} times that of the exact model; on the "
            f"circle at {s.speeds[0, -1]:.2f} m/s {_change(s, BARE, -1)}",
            bool((s.position[BARE] > WORSE * s.position[EXACT]).all()),
            "the size depends on the feedback: error = M̂⁻¹Δ/k_p",
            own=s is not own,
        )
        for s in studies
    ]
    checks.append(
        Check(
            f"the same on the paper's own circle, {own.durations[0, 0]:g} s",
            "“significant differences at F_x, F_y, and M_Z … may deteriorate the required control performance”",
            _change(own, BARE, 0),
            bool((own.position[BARE, :, 0, 0] > WORSE * own.position[EXACT, :, 0, 0]).all()),
            f"true in proportion; at {own.speeds[0, 0]:.2f} m/s the loss is below "
            f"{np.ceil(1e4 * own.position[BARE, SOFT, 0, 0]) / 10:g} mm even with soft feedback",
        )
    )
    checks += [
        Check(
            f"performance with the model as printed, without (D1), {s.robot}",
            "“accurate dynamic model taking into account the wheel dynamics”" if s is own else "worse than with it",
            f"position RMSE {_span(s.position[PRINTED] / s.position[EXACT], 1)} times that of the exact model; "
            f"on the circle at {s.speeds[0, -1]:.2f} m/s {_change(s, PRINTED, -1)}",
            bool((s.position[PRINTED] < EQUAL * s.position[EXACT]).all() == (s is own)),
            f"E3: (D1) is missing; what that does is "
            f"{_span(s.apart[PRINTED] / s.apart[BARE])} of what leaving the wheels out does",
            own=s is not own,
        )
        for s in studies
    ]
    return tuple(checks)


def _difference(own: Study) -> Difference:
    return Difference(
        "E3",
        "(43), (47): the model as a controller's knowledge",
        "(49) as printed: without (D1)",
        "(D1) is needed for tracking as well",
        f"computed torque on {own.robot}, circle at {own.speeds[0, -1]:.2f} m/s: {_change(own, PRINTED, -1)}",
    )


def _tables(studies: list[Study]) -> tuple[Table, ...]:
    cases = [(s, p, q) for s in studies for p in range(len(PATHS)) for q in range(len(FREQUENCIES))]
    names = list(PATHS)

    def row(s: Study, p: int, q: int, rung: int) -> list[str | float]:
        errors = 1e3 * s.position[:, q, p, rung]
        head: list[str | float] = [s.robot, names[p], float(s.speeds[p, rung]), FREQUENCIES[q]]
        return [*head, *errors.tolist(), *(errors[1:] / errors[0]).tolist()]

    def rest(s: Study, p: int, q: int, rung: int) -> list[float]:
        parts = (
            1e3 * s.heading,
            1e3 * s.worst,
            1e2 * s.effort,
            *(1e3 * x[1:] for x in (s.apart, s.predicted, s.balanced)),
        )
        return [float(x) for part in parts for x in part[:, q, p, rung]]

    head = ("robot", "path", "mean speed [m/s]", "ω_n [rad/s]", *(f"{model} [mm]" for model in MODELS))
    head = (*head, *(f"{model} / exact" for model in MODELS[1:]))
    more = (
        *(f"{what}, {model}" for what in ("heading RMSE [mrad]", "worst [mm]", "effort [%]") for model in MODELS),
        *(f"{what} [mm], {model}" for what in ("model alone", "predicted", "slow law") for model in MODELS[1:]),
    )
    return (
        Table(
            "incomplete_models",
            "Position RMSE of computed torque by model, at the lowest and the highest speed.",
            head,
            [row(*case, rung) for case in cases for rung in (0, -1)],
        ),
        Table(
            "incomplete_models_all",
            "All speeds, with heading, worst error, effort, what the model alone does, and what the law predicts.",
            (*head, *more),
            [[*row(*case, rung), *rest(*case, rung)] for case in cases for rung in range(RUNGS)],
        ),
        Table(
            "incomplete_models_law",
            "The law beside the simulation: power of the speed with which the error grows (of the exact model its own "
            "error, of the others what the model alone does), and the law's prediction over the simulated, least and "
            "greatest of all speeds; the slow law at the highest speed.",
            (
                "robot",
                "path",
                "ω_n [rad/s]",
                "model",
                "power of speed",
                "predicted / simulated",
                "slow law / simulated",
            ),
            [_law_row(*case, m) for case in cases for m in range(len(MODELS))],
        ),
        Table(
            "incomplete_models_hold",
            "What holding torques costs the exact model at the highest speed: position RMSE by control period, and the "
            "power of the period with which k_p times the error grows.",
            ("robot", "path", "ω_n [rad/s]", f"{1e3 * PERIOD:g} ms [mm]", f"{1e3 * FINE_PERIOD:g} ms [mm]", "power"),
            [
                (s.robot, path, f, 1e3 * float(_coarse(s)[q, p]), 1e3 * float(s.held[q, p]), float(_order(s)[q, p]))
                for s in studies
                for p, path in enumerate(HELD)
                for q, f in enumerate(FREQUENCIES)
            ],
        ),
        Table(
            "incomplete_models_disturbed",
            f"The highest speed from {STARTS} starts beside the reference with casters anyhow, as the benchmark has "
            f"them: position RMSE from {METRICS.settling:g} s on. Soft feedback is still settling then.",
            head,
            [
                [*row(*case, -1)[:4], *(1e3 * e).tolist(), *(e[1:] / e[0]).tolist()]
                for case in cases
                for e in [case[0].disturbed[:, case[2], case[1]]]
            ],
        ),
    )


def _law_row(s: Study, p: int, q: int, m: int) -> list[str | float]:
    grown = s.position if m == EXACT else s.apart
    power = float(exponents(grown[m, q, p], s.speeds[p]))
    head: list[str | float] = [s.robot, list(PATHS)[p], FREQUENCIES[q], MODELS[m], power]
    if m == EXACT:
        return [*head, "", ""]
    ratio = s.predicted[m, q, p] / s.apart[m, q, p]
    return [*head, _span(ratio, 3), float(s.balanced[m, q, p, -1] / s.apart[m, q, p, -1])]


def _coarse(s: Study) -> Array:
    """RMSE (frequencies, HELD) of the exact model on the fastest rung at the usual period. [m]"""
    return s.position[EXACT, :, [list(PATHS).index(path) for path in HELD], -1].T


def _order(s: Study) -> Array:
    """Power (frequencies, HELD) of the period with which k_p times that error grows."""
    stiffness = np.array([[gains(f, period).stiffness for f in FREQUENCIES] for period in (PERIOD, FINE_PERIOD)])
    ratio = _coarse(s) * stiffness[0, :, None] / (s.held * stiffness[1, :, None])
    order: Array = np.log(ratio) / np.log(PERIOD / FINE_PERIOD)
    return order


def _change(s: Study, model: int, rung: int) -> str:
    """Position RMSE on the circle, from the exact model's to another's, at each natural frequency."""
    parts = [
        f"{_length(s.position[EXACT, q, 0, rung])} → {_length(s.position[model, q, 0, rung])} at {f:g} rad/s"
        for q, f in enumerate(FREQUENCIES)
    ]
    return ", ".join(parts)


def _span(values: Array, digits: int = 2) -> str:
    return f"{values.min():.{digits}f} … {values.max():.{digits}f}"


def _length(metres: float) -> str:
    return f"{1e3 * metres:.2g} mm" if metres >= 1e-4 else f"{1e6 * metres:.2g} µm"
