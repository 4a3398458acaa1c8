"""Cells of three and four blocks that move alike, where waves that run either way round the cell cease to grow together:
every such place of a branch is listed, where SciPy finds that the multiplier of that wave on one block passes 1."""
import numpy as np
from scipy.integrate import solve_ivp

from calls import check, run
from reference import System, words

TIGHT = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-12}


def scene(random):
    m, f0, k0 = random.uniform(0.5, 2), random.uniform(0.7, 1.5), random.uniform(0.1, 0.6)
    side = random.choice([-1, 1])
    return {"model_form": "chain", "model_m": m, "model_k0": k0, "model_f0": f0, "model_zeta": f0 * random.uniform(0, 0.1),
            "model_v": side * np.sqrt(1 - 0.1) * random.uniform(0, 0.4), "init_psi": side * 0.6}


class Block:
    """One block with the cubic law: its oscillation, and the multipliers of a wave that adds `spring` to its stiffness."""

    def __init__(self, p):
        self.k0, self.system = p["model_k0"], System(p | {"grid_n": 1, "model_k1": 1})
        up = lambda t, y: y[0] - p["model_v"]  # noqa: E731
        up.direction = 1
        # long enough to settle, then from one passage of psi = v to the next
        settled = solve_ivp(self.system.rates, (0, 400), [p["model_v"] + 1, 0], events=up, **TIGHT)
        self.start = settled.y_events[0][-1]
        turn = solve_ivp(self.system.rates, (0, 100), self.start, events=up, **TIGHT)
        self.period = next(t for t in turn.t_events[0] if t > 1e-3)

    def growth(self, springs):
        """Largest modulus less 1."""
        matrices = self.system.carried(self.start, self.period, -np.reshape(springs, (-1, 1, 1)))[1]
        return abs(np.linalg.eigvals(matrices)).max(axis=1) - 1

    def limit(self):
        """The spring beyond which the wave decays, nan where waves of no length grow."""
        springs = self.k0 * np.geomspace(0.02, 20, 25)
        for _ in range(4):  # all springs of a round at once
            growth = self.growth(springs)
            signs = np.flatnonzero(np.sign(growth[:-1]) != np.sign(growth[1:]))
            if len(signs) != 1 or growth[-1] > 0:
                return np.nan
            low, high = springs[signs[0]:signs[0] + 2]
            springs = np.linspace(low, high, 9)
        return low + (high - low) * growth[signs[0]] / (growth[signs[0]] - growth[signs[0] + 1])


def compare(p, limit, what):
    """The places that the program lists against those of waves of this cell."""
    cell = p["cycle_cell"]
    places = sorted({limit / (2 - 2 * np.cos(2 * np.pi * j / cell)) for j in range(1, cell // 2 + 1)})
    low, high = 0.8 * places[0], 1.25 * places[-1]
    found = run(words(p | {"grid_n": 2 * cell, "model_k1": low, "cycle_continue": "model_k1", "cycle_to": high}), command="cycle")[0]
    found = sorted((s["value"], s["kind"]) for s in found["special"])
    check([kind for _, kind in found] == ["branch"] * len(places) and
          all(abs(at - place) < 1e-6 * (high - low) for (at, _), place in zip(found, places)),
          f"{what}: {found} instead of {places}: {p}")


def test_waves_of_a_cell_that_cease_to_grow_together(scenes):
    compared = 0
    for index, block in scenes(scene, 73, short=1):
        limit = Block(block).limit()
        if not limit > 0:
            continue
        # a cell of three, and one of four in the mirror image, whose block has the same multipliers
        mirror = {name: -block[name] for name in ("model_v", "init_psi")}
        for p in (block | {"cycle_cell": 3}, block | mirror | {"cycle_cell": 4}):
            compare(p, limit, f"scene {index}")
        compared += 1
    check(compared > 0, "scenes whose waves grow")
