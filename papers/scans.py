"""What was repaired in the scanned texts of the papers without counting it: places that can be read in one way only."""

from typing import NamedTuple


class Repair(NamedTuple):
    """A place of a scanned text that character recognition spoilt, or that print has as an obvious slip."""

    where: str
    scanned: str
    read_as: str


REPAIRS: dict[str, tuple[Repair, ...]] = {
    "chung2008": (
        Repair("(12), (15), (16)", "matrices without their numbers", "the numbers that the text refers to"),
        Repair("(19), (42)", "a φ or a ring over φ", "φ̈, as the left side of an acceleration"),
        Repair("after (24)", "G = G_a + G_n J_n⁻¹ J_a", "G = G_a + G_p J_p⁻¹ J_a, as (21) and (22) give it"),
        Repair("(24)", "ṫ over ṫ; φ̈_α", "ṫ; φ̈_a"),
        Repair("after (31)", "(1)", "(32), the Lagrange equation"),
        Repair("(49)", "a sum to n; brackets that do not close", "a sum to 3 over both of the first two terms"),
        Repair("(49), last term", "not given", "m_pl ω × v_c, the platform's own force in the body frame"),
        Repair("after (52)", "[pl I*_uu] and [pl I*_uu]", "[pl I*_uu] and [pl P*_uuu]"),
        Repair(
            "before (53)", "a vector e that is normal to the contact surface", "n, as in (53); e is the restitution"
        ),
        Repair("Table 1", "columns l, r, D, A, b, H with a bar", "l, r, d, a, b, H"),
        Repair("Table 2, wheel", '"0 .7813" and "1.5625, 0" across lines', "diag(0.7813, 1.5625, 0.7813) · 1e-4 kg m²"),
        Repair("Appendix A.1", "∂²u over ∂φ∂φ without a subject", "the definition of H_φφ below (18)"),
        Repair("conclusions", "numbered 5, like the simulation", "section 6"),
    ),
    "kim2001": (
        Repair("(31), (33), (34); IV, text", "v_bv, v_bh, v_h", "v_bx and v_by"),
        Repair("after (9)", "φ is a relative angular velocity", "φ is the steering angle of (3)"),
        Repair("(10)", "the active joint velocity vector φ̇ = (η̇, θ̇, φ̇)", "the joint rates of one wheel"),
        Repair("(19), (26)", "a matrix that equals itself", "the definitions of the inverses, which (20) to (22) hold"),
        Repair("section III", "[i G_θ^a]", "[i G_φ^u] of (14)"),
        Repair("section III, four joints", "(θ_1, φ_1, θ_1, φ_k) and the like", "indices i, j, k of three wheels"),
        Repair("heading of section IV", "VI.", "IV."),
        Repair("section IV, sets of joints", "θ_21", "θ_2"),
        Repair("(29), (35)", "σ_l, G_ai, G_ii", "σ_i of (28), taken of (31)"),
        Repair("(32)", "φ_i / φ_i max", "φ̇_i / φ̇_i max"),
        Repair(
            "section IV, grid of r and d",
            '"divided into 20 sub-sections, i.e., interval of r from 0.1a to 1a"',
            "20 values: tenths of a to 1, then 10^(k/10) in two digits, found by search",
        ),
        Repair("foot of Table 1", "joints with dots on some types", "the joints of types 1 to 5"),
    ),
}
