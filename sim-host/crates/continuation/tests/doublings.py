"""Period doublings by shooting with DOP853 of SciPy: an independent check of the continuation.

Variational equations by hand-written Jacobians; the doubling is where an eigenvalue of the monodromy matrix is -1.
"""
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

OPTIONS = dict(method="DOP853", rtol=1e-12, atol=1e-13)


def monodromy(f, jacobian, x, period):
    n = len(x)

    def rates(t, y):
        return np.concatenate([f(y[:n]), (jacobian(y[:n]) @ y[n:].reshape(n, n)).ravel()])

    end = solve_ivp(rates, (0, period), np.concatenate([x, np.eye(n).ravel()]), **OPTIONS).y[:, -1]
    return end[:n], end[n:].reshape(n, n)


def orbit(f, jacobian, x, period):
    """Newton's method for a state and a period, in the plane across the flow."""
    n = len(x)
    for _ in range(20):
        end, matrix = monodromy(f, jacobian, x, period)
        a = np.zeros((n + 1, n + 1))
        a[:n, :n] = matrix - np.eye(n)
        a[:n, n] = f(end)
        a[n, :n] = f(x)
        step = np.linalg.solve(a, np.concatenate([x - end, [0]]))
        x, period = x + step[:n], period + step[n]
        if np.abs(step).max() < 1e-11:
            break
    return x, period, matrix


def doubling(family, x, period, low, high):
    """The parameter between low and high at which a multiplier is -1, and the orbit there."""
    state = [x, period]

    def test(p):
        f, jacobian = family(p)
        state[0], state[1], matrix = orbit(f, jacobian, *state)
        values = np.linalg.eigvals(matrix)
        trivial = np.argmin(abs(values - 1))
        return np.prod(np.delete(values, trivial) + 1).real

    p = brentq(test, low, high, xtol=1e-11, rtol=1e-14)
    return p, state[0], state[1]


def roessler(c):
    f = lambda x: np.array([-x[1] - x[2], x[0] + 0.2 * x[1], 0.2 + x[2] * (x[0] - c)])
    jacobian = lambda x: np.array([[0, -1, -1], [1, 0.2, 0], [x[2], 0, x[0] - c]])
    return f, jacobian


def duffing(gamma):
    """x'' + 0.2 x' - x + x^3 = gamma cos t, the force by an oscillator."""

    def f(x):
        g = 1 - x[2] ** 2 - x[3] ** 2
        return np.array([x[1], x[0] - x[0] ** 3 - 0.2 * x[1] + gamma * x[2], x[2] * g - x[3], x[3] * g + x[2]])

    def jacobian(x):
        u, v = x[2], x[3]
        g = 1 - u * u - v * v
        return np.array(
            [
                [0, 1, 0, 0],
                [1 - 3 * x[0] ** 2, -0.2, gamma, 0],
                [0, 0, g - 2 * u * u, -2 * u * v - 1],
                [0, 0, 1 - 2 * u * v, g - 2 * v * v],
            ]
        )

    return f, jacobian


def vehicle(rpm):
    """The preset `reconstruction` without friction."""
    v = 2 * np.pi * 0.3 * rpm / 60
    m, iz, lf, lr = 1500, 2000, 1.2, 1.3
    inertia, damping, torque, trail = 10.0, 200.0, 30 * 0.078 * 10 * 0.7, 0.022

    def cubic(b, c, d, e):
        return b * c * d, d * e * c * b**3 / 3 + d * c * b**3 / 3 + d * (c * b) ** 3 / 6

    (k1, k2), (k3, k4) = cubic(11.275, 1.56, 2574.7, -1.999), cubic(18.631, 1.56, 1749.7, -1.7908)

    def f(x):
        af, ar = x[0] + lf * x[1] / v - x[2], x[0] - lr * x[1] / v
        ff, fr = k1 * af - k2 * af**3, k3 * ar - k4 * ar**3
        return np.array(
            [(ff + fr) / (m * v) - x[1], (lf * ff - lr * fr) / iz, x[3], (torque - trail * ff - damping * x[3]) / inertia]
        )

    def jacobian(x):
        af, ar = x[0] + lf * x[1] / v - x[2], x[0] - lr * x[1] / v
        sf, sr = k1 - 3 * k2 * af**2, k3 - 3 * k4 * ar**2
        df, dr = sf * np.array([1, lf / v, -1, 0]), sr * np.array([1, -lr / v, 0, 0])
        return np.array(
            [
                (df + dr) / (m * v) - [0, 1, 0, 0],
                (lf * df - lr * dr) / iz,
                [0, 0, 0, 1],
                -trail / inertia * df - [0, 0, 0, damping / inertia],
            ]
        )

    return f, jacobian


def settled(family, p, x, time):
    return solve_ivp(lambda t, y: family(p)[0](y), (0, time), x, **OPTIONS).y[:, -1]


if __name__ == "__main__":
    x = settled(roessler, 2.5, [1, 1, 0], 400)
    c, xc, period = doubling(roessler, x, 5.76, 2.5, 3.2)
    print("roessler", repr(c), period)
    x = settled(roessler, 3.2, [1, 1, 0], 900)
    c, xc, period = doubling(roessler, x, 11.6, 3.2, 3.95)
    print("roessler, second", repr(c), period)
    x = settled(vehicle, 1700.0, [0.15, 0, 0.46, 0], 300)
    n, xn, period = doubling(vehicle, x, 1.4882, 1700.0, 1760.0)
    print("vehicle without friction", repr(n), period)
    x = settled(duffing, 0.14, [0.2, 0.3, 1, 0], 600)
    g, xg, period = doubling(duffing, x, 2 * np.pi, 0.14, 0.16)
    print("duffing", repr(g), period)
