"""Vectors of three scalars and symmetric 3×3 matrices (xx, xy, xz, yy, yz, zz), for three degrees of freedom."""

from caster_gym.mechanics.scalars import Direction, Scalar, Symmetric, Vector, clip, maximum, sqrt, where

NEWTON_STEPS = 5  # from 2 to a root in [√3, 2] of a cubic whose slope there is at least 6: below rounding


def dot(a: Vector, b: Vector) -> Scalar:
    """a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def subtract(a: Vector, b: Vector) -> Vector:
    """a − b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scale(h: Scalar, a: Vector) -> Vector:
    """h a."""
    return h * a[0], h * a[1], h * a[2]


def shift(h: Scalar, a: Vector, b: Vector) -> Vector:
    """a + h b."""
    return a[0] + h * b[0], a[1] + h * b[1], a[2] + h * b[2]


def scale_pair(h: Scalar, a: Direction) -> Direction:
    """h a, of two numbers."""
    return h * a[0], h * a[1]


def shift_pair(h: Scalar, a: Direction, b: Direction) -> Direction:
    """a + h b, of two numbers."""
    return a[0] + h * b[0], a[1] + h * b[1]


def length(a: Direction) -> Scalar:
    """|a|, of a vector of the plane."""
    return sqrt(a[0] * a[0] + a[1] * a[1])


def rotate(f: Direction, a: Direction) -> Direction:
    """A vector of the plane turned by the angle of a unit vector: from components along f and f⊥ to those beside f."""
    return f[0] * a[0] - f[1] * a[1], f[1] * a[0] + f[0] * a[1]


def solve(m: Symmetric, b: Vector) -> Vector:
    """x of M x = b for a symmetric positive definite M, by its L D Lᵀ factors."""
    xx, xy, xz, yy, yz, zz = m
    l_yx, l_zx = xy / xx, xz / xx
    d_y, r_zy = yy - l_yx * xy, yz - l_yx * xz
    l_zy = r_zy / d_y
    d_z = zz - l_zx * xz - l_zy * r_zy
    y = b[1] - l_yx * b[0]
    z = (b[2] - l_zx * b[0] - l_zy * y) / d_z
    y = y / d_y - l_zy * z
    return b[0] / xx - l_yx * y - l_zx * z, y, z


def factors(m: Symmetric) -> Symmetric:
    """What `solve` finds of a matrix, for several right sides: l_yx, l_zx, l_zy and the inverses of D."""
    xx, xy, xz, yy, yz, zz = m
    x = 1.0 / xx
    l_yx, l_zx = xy * x, xz * x
    r_zy = yz - l_yx * xz
    y = 1.0 / (yy - l_yx * xy)
    l_zy = r_zy * y
    return l_yx, l_zx, l_zy, x, y, 1.0 / (zz - l_zx * xz - l_zy * r_zy)


def substitute(found: Symmetric, b: Vector) -> Vector:
    """x of M x = b from the `factors` of M."""
    l_yx, l_zx, l_zy, x, y, z = found
    b_y = b[1] - l_yx * b[0]
    last = (b[2] - l_zx * b[0] - l_zy * b_y) * z
    middle = b_y * y - l_zy * last
    return b[0] * x - l_yx * middle - l_zx * last, middle, last


def multiply(m: Symmetric, v: Vector) -> Vector:
    """M v."""
    xx, xy, xz, yy, yz, zz = m
    return (
        xx * v[0] + xy * v[1] + xz * v[2],
        xy * v[0] + yy * v[1] + yz * v[2],
        xz * v[0] + yz * v[1] + zz * v[2],
    )


def extreme_eigenvalues(m: Symmetric) -> tuple[Scalar, Scalar]:
    """Least and greatest eigenvalue of a symmetric matrix, without trigonometry.

    With λ = mean + size · z, √6 size the norm of what the mean leaves, the characteristic polynomial becomes
    z³ − 3 z = 2 κ, |κ| <= 1. Of its three real roots one lies apart from the others, |z| in [√3, 2]: Newton's steps
    from 2 find it, and the rest is a quadratic equation.
    """
    xx, xy, xz, yy, yz, zz = m
    mean = (xx + yy + zz) / 3.0
    a, b, c = xx - mean, yy - mean, zz - mean  # the mean goes first: nothing cancels when the eigenvalues are close
    squares = 0.5 * (a * a + b * b + c * c) + xy * xy + xz * xz + yz * yz
    det = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz)
    size = sqrt(squares / 3.0)
    kappa = clip(0.5 * det / maximum(size * size * size, 1e-300), -1.0, 1.0)
    apart = where(kappa < 0.0, -kappa, kappa)
    z = 2.0 + 0.0 * mean
    for _ in range(NEWTON_STEPS):
        z = z - ((z * z - 3.0) * z - 2.0 * apart) / (3.0 * z * z - 3.0)
    w = 0.5 * (z + sqrt(maximum(12.0 - 3.0 * z * z, 0.0 * z)))  # the root farthest from z is −w
    low = where(kappa < 0.0, -z, -w)
    high = where(kappa < 0.0, w, z)
    return mean + size * low, mean + size * high
