"""A machine of modes by other means: matrix exponentials and bisection, with the work of every force on the way.

The augmented coordinates z = (q, q', 1, cos and sin of each harmonic) of a machine between two changes of contact obey
z' = A z, and every power is a quadratic form z' Q z. So a step is expm(A h), the work done in it is z' G z with
G = int expm(A s)' Q expm(A s) ds by Van Loan's exponential, and an event is found by halving the step. No modes of the
machine in contact, no rest positions, no bounds: nothing is shared with the kernel but the matrices.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

HALVINGS = 36
PHASE = 0.1
AHEAD = 64
"""Steps that are looked at together."""
MOST_STAYS = 20_000
GAP, CONTACT, DETACHED = range(3)


@dataclass
class Balance:
    """Work of the loads, what is dissipated, and the sum of both without signs [J]."""

    work: float = 0.0
    dissipated: float = 0.0
    through: float = 0.0


def _doubts(values, slopes, h):
    """Between which neighbours (k + 1, rows) of a path which row may fall through zero, by the cubic through both."""
    shares = np.linspace(0.0, 1.0, 33)[:, None, None]
    rest = 1.0 - shares
    path = rest**2 * (values[:-1] * (1.0 + 2.0 * shares) + slopes[:-1] * h * shares)
    path += shares**2 * (values[1:] * (1.0 + 2.0 * rest) - slopes[1:] * h * rest)
    dips = (slopes[:-1] < 0.0) & (slopes[1:] > 0.0) & (path.min(axis=0) < 0.0)
    return (values[1:] < 0.0) | dips


class _Regime:
    """Steps of h / 2^k in one regime, and the integrals of work and dissipation over them; 1, 2 ... steps of h."""

    def __init__(self, a, power, loss, h):
        self.a, self.h, size = a, h, len(a)
        block = np.zeros((2 * size, 2 * size))
        block[:size, :size], block[size:, size:] = -a.T, a
        self.steps, self.works, self.losses = [], [], []
        for k in range(HALVINGS):
            step = expm(a * h / 2**k)
            self.steps.append(step)
            for form, kept in ((power, self.works), (loss, self.losses)):
                block[:size, size:] = form
                kept.append(step.T @ expm(block * h / 2**k)[:size, size:])
        self.ahead = np.array([expm(a * h * (i + 1)) for i in range(AHEAD)])


class Referee:
    """Follows a ``ModalImpactModel`` cycle by cycle.

    Coordinates are turned so that the first moves the tip alone; beyond a stop it counts from there, so that a force of
    contact is no difference of large numbers.
    """

    def __init__(self, model):
        self.model, self.n = model, len(model.tip_shape)
        n, tip = self.n, model.tip_shape
        self.omega = 2.0 * np.pi * model.excitation_frequency
        self.turn = np.linalg.qr(np.column_stack([tip, np.eye(n)]))[0]
        self.reach = float(self.turn[:, 0] @ tip)
        stiffness, damping = (self.turn.T @ each @ self.turn for each in (np.diag(model.stiffness), model.damping))
        drive = (model.drive[0] + self.omega**2 * model.drive[1]) @ self.turn
        harmonics = len(drive)
        self.size = size = 2 * n + 1 + 2 * harmonics
        base, load = np.zeros((size, size)), np.zeros((n, size))
        base[:n, n : 2 * n] = np.eye(n)
        base[n : 2 * n, :n], base[n : 2 * n, n : 2 * n] = -stiffness, -damping
        load[:, 2 * n] = model.static_force @ self.turn
        for g in range(harmonics):
            c, s = 2 * n + 1 + 2 * g, 2 * n + 2 + 2 * g
            load[:, c], load[:, s] = drive[g]
            base[c, s], base[s, c] = -(g + 1) * self.omega, (g + 1) * self.omega
        base[n : 2 * n] += load
        power, loss = np.zeros((size, size)), np.zeros((size, size))
        power[n : 2 * n] = load
        loss[n : 2 * n, n : 2 * n] = damping
        self.regimes = {}
        for side in (0, 1, -1):
            if side and not np.isfinite(self.stop(side)):
                continue
            for state in (GAP,) if side == 0 else (CONTACT, DETACHED):
                a, lost = base.copy(), loss.copy()
                a[n : 2 * n, 2 * n] -= stiffness[:, 0] * self.stop(side) / self.reach
                if side:
                    k, d, depth, force = self.contact(side, side)
                    if state == CONTACT:
                        a[n] -= side * self.reach * force
                        lost[n, n] += d * self.reach**2
                    else:
                        lost[n] -= side * self.reach * k * depth
                rate = max(np.max(np.abs(np.linalg.eigvals(a))), harmonics * self.omega)
                self.regimes[state, side] = _Regime(a, power, lost, PHASE / rate)

    def stop(self, side):
        """Position of a stop; 0 for none."""
        return self.model.stops[(1 - side) // 2] if side else 0.0

    def contact(self, side, frame):
        """Spring, damper, and the rows of penetration and force of a stop, in coordinates of a frame."""
        k, d = self.model.contact_stiffness[(1 - side) // 2], self.model.contact_damping[(1 - side) // 2]
        depth, rate = np.zeros(self.size), np.zeros(self.size)
        depth[0] = rate[self.n] = side * self.reach
        depth[2 * self.n] = side * (self.stop(frame) - self.stop(side))
        return k, d, depth, k * depth + d * rate

    def energy(self, state):
        """Energy [J] of modes and springs of the stops."""
        q, v = np.split(np.asarray(state), 2)
        total = 0.5 * float(v @ v + self.model.stiffness @ q**2)
        for side in (1, -1):
            if np.isfinite(self.stop(side)):
                beyond = max(0.0, side * (float(self.model.tip_shape @ q) - self.stop(side)))
                total += 0.5 * self.model.contact_stiffness[(1 - side) // 2] * beyond**2
        return total

    def start(self, state):
        """Augmented coordinates of a state at the start of a cycle."""
        z = np.zeros(self.size)
        z[: 2 * self.n], z[2 * self.n] = (np.reshape(state, (2, -1)) @ self.turn).ravel(), 1.0
        z[2 * self.n + 1 :: 2] = 1.0
        return z

    def leaving(self, where, side):
        """Rows that end a stay in a state where they fall to zero, and the sides of what comes next."""
        if where == GAP:
            return [(-self.contact(s, 0)[2], s) for s in (1, -1) if (CONTACT, s) in self.regimes]
        _, _, depth, force = self.contact(side, side)
        return [(force, 0)] if where == CONTACT else [(depth, 0), (-force, side)]

    def cycle(self, state):
        """(State after one cycle, ``Balance``, largest force, number of touches)."""
        z, balance, peak, touches, stays = self.start(state), Balance(), 0.0, 0, 0
        where, side, frame = GAP, 0, 0
        for s in (1, -1):
            if (CONTACT, s) in self.regimes:
                _, _, depth, force = self.contact(s, 0)
                if depth @ z > 0.0:
                    where, side = (CONTACT if force @ z > 0.0 else DETACHED), s
        left = 1.0 / self.model.excitation_frequency
        while True:
            z[0] += (self.stop(frame) - self.stop(side)) / self.reach
            frame = side
            regime, ends = self.regimes[where, side], self.leaving(where, side)
            rows = np.array([row for row, _ in ends]).reshape(len(ends), len(z))
            z, spent, fired = self._until(regime, rows, z, left, balance)
            if where == CONTACT:
                peak = max(peak, fired[1])
            left, stays = left - spent, stays + 1
            assert stays < MOST_STAYS
            if fired[0] is None:
                break
            target = ends[fired[0]][1]
            if where == GAP or (where == DETACHED and target):
                where, side, touches = CONTACT, target, touches + 1
            elif where == CONTACT:
                where = DETACHED
            else:
                where, side = GAP, 0
        z[0] += self.stop(frame) / self.reach
        return (z[: 2 * self.n].reshape(2, -1) @ self.turn.T).ravel(), balance, peak, touches

    def _until(self, regime, rows, z, left, balance):
        """Follow z until a row falls through zero or the time is up: (z, time, (row or None, largest first row)).

        A row that starts at zero or just below and rises, as after the event that began the stay, counts from where it
        starts; one that falls ends the stay at once.
        """
        spent, values, slopes = 0.0, rows @ z, rows @ (regime.a @ z)
        largest, rises = max([0.0, *values[:1]]), (values <= 0.0) & (slopes > 0.0)
        if np.any((values < 0.0) & ~rises):
            return z, 0.0, (int(np.argmax((values < 0.0) & ~rises)), largest)
        rows = rows.copy()
        rows[rises, 2 * self.n] -= values[rises]
        rates = rows @ regime.a

        def take(path, k):
            """Go along a path of steps h / 2^k: (its end, largest first row)."""
            before = path[:-1]
            work, loss = (np.sum((before @ form[k]) * before, axis=1) for form in (regime.works, regime.losses))
            balance.work += float(work.sum())
            balance.dissipated += float(loss.sum())
            balance.through += float(np.abs(work).sum() + np.abs(loss).sum())
            return path[-1], max([largest, *(path[1:] @ rows[:1].T).ravel()])

        while spent + regime.h / 2 ** (HALVINGS - 1) <= left:
            count, falls = min(AHEAD, int((left - spent) / regime.h)), np.zeros(len(rows), bool)
            if count:
                path = np.vstack([z, regime.ahead[:count] @ z])
                doubts = _doubts(path @ rows.T, path @ rates.T, regime.h).any(axis=1)
                passed = int(np.argmax(doubts)) if doubts.any() else count
                z, largest = take(path[: passed + 1], 0)
                spent += passed * regime.h
                if passed == count:
                    continue
                falls = rows @ path[passed + 1] < 0.0
            # into the step in which a row falls, or the rest of the time, by ever shorter steps in which none does
            for k in range(1, HALVINGS):
                if spent + regime.h / 2**k > left:
                    continue
                path = np.vstack([z, regime.steps[k] @ z])
                doubts, below = _doubts(path @ rows.T, path @ rates.T, regime.h / 2**k)[0], rows @ path[1] < 0.0
                falls = below if below.any() else falls
                if doubts.any() and k < HALVINGS - 1:
                    continue
                z, largest = take(path, k)
                spent += regime.h / 2**k
                falls = doubts if doubts.any() else falls
            if falls.any():
                return z, spent, (int(np.argmax(falls)), largest)
        return z, spent, (None, largest)
