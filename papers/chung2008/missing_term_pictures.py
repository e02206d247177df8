"""Pictures of the term that chung2008 leaves out: forces on its circle, and shares at random states."""

from typing import NamedTuple

import numpy as np

from caster_gym.arrays import Array
from caster_gym.report.figures import COLOURS, new_figure
from papers.chung2008.motion_pictures import FORCE_AXES
from papers.page import Picture

__all__ = ["FORCE_AXES", "Forces", "picture_at_random", "picture_on_circle"]


class Forces(NamedTuple):
    """Operational forces (K + 1, 3) of one robot along one motion, in the body frame, by both models."""

    robot: str
    time: Array  # (K + 1,) [s]
    exact: Array
    printed: Array  # without (D1)

    @property
    def missing(self) -> Array:
        """What the printed model lacks."""
        return self.exact - self.printed


def picture_on_circle(robots: list[Forces], radius: float, speed: float) -> Picture:
    """A row for each robot: F_x, F_y and M_z along the circle by both models, and their difference."""
    figure = new_figure(len(robots), 3, size=(4.0, 2.9), sharex=True)
    for row, one in enumerate(robots):
        for k, axis in enumerate(figure.axes[3 * row : 3 * row + 3]):
            axis.plot(one.time, one.printed[:, k], color=COLOURS[1], linewidth=4.0, label="as printed, without (D1)")
            axis.plot(one.time, one.exact[:, k], color=COLOURS[7], linewidth=1.4, label="exact")
            axis.plot(one.time, one.missing[:, k], "--", color=COLOURS[3], linewidth=1.6, label="exact less printed")
            axis.set(ylabel=FORCE_AXES[k], title=one.robot)
            if row == len(robots) - 1:
                axis.set_xlabel("time [s]")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside upper center", ncol=3, fontsize=9)
    shares = " and ".join(
        f"{np.abs(one.missing[:, 0]).max() / np.abs(one.exact[:, 0]).max():.1%} of it on {one.robot}" for one in robots
    )
    caption = (
        f"Operational forces along the circle of Figs. 8 and 9 ({radius:g} m), driven in {robots[0].time[-1]:.2f} s so "
        f"that the greatest speed is {speed:g} m/s, body frame. The printed model lacks a force across the path, F_x: "
        f"{shares}, where it is greatest; in F_y and M_z both models are one."
    )
    return Picture("missing_circle", "Forces on the circle by the exact and the printed model", caption, figure)


def picture_at_random(at_random: dict[str, tuple[Array, Array]], said: tuple[float, float]) -> Picture:
    """Distribution of the missing term's share in h and in the force; said: the band that is claimed for h."""
    count = len(next(iter(at_random.values()))[0])
    figure = new_figure(1, 2, size=(5.2, 3.3), sharey=True)
    levels = np.linspace(0.0, 100.0, count)
    for axis, k, what in zip(figure.axes, (0, 1), ("h", "F"), strict=True):
        for (name, shares), colour, style in zip(
            at_random.items(), (COLOURS[0], COLOURS[3], COLOURS[4]), ("-", "--", "-."), strict=True
        ):
            axis.semilogx(100.0 * np.sort(shares[k]), levels, style, color=colour, label=name)
        axis.set(xlabel=f"missing term / {what} [%]", xlim=(0.2, 200.0))
    low, high = (100.0 * share for share in said)
    figure.axes[0].axvspan(low, high, color=COLOURS[1], alpha=0.2, label=f"{low:.0f} to {high:.0f} %")
    figure.axes[0].set_ylabel("states below [%]")
    figure.axes[0].legend(fontsize=8, loc="upper left")
    caption = (
        f"Share of the missing term in h and in the force at {count} random states with |ν| = |ν̇| = 1 in SI units: "
        "half of all states of chung2008's robot lie in the band. The share of h is the same at every speed."
    )
    return Picture("missing_at_random", "Share of the missing term at random states", caption, figure)
