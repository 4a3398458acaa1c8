"""Random scenes of steady sliding, as options by name (tests/reference.py)."""


def friction_of(random):
    """Options of a random law and state law."""
    choices = [("cubic", "none"), ("cubic", "contact-age"), ("carlson-langer", "none"), ("coulomb", "contact-age"),
               ("carlson-langer", "healing"), ("rate-and-state", "ageing"), ("rate-and-state", "slip")]
    name, state = choices[random.integers(len(choices))]
    p = {"friction_law": name, "state_law": state}
    if name == "rate-and-state":
        D = random.uniform(0.3, 2)
        p |= {"friction_a": random.uniform(0.02, 0.2), "friction_b": random.uniform(0.02, 0.3), "friction_D": D}
    elif state == "healing":
        p |= {"state_t_h": random.uniform(0.5, 3), "state_tau_inf": random.uniform(1.1, 3),
              "state_D": random.uniform(0.3, 3)}
    elif state == "contact-age":
        p |= {"state_b": random.uniform(0.05, 1), "state_D": random.uniform(0.3, 3),
              "state_theta0": random.uniform(0.3, 3)}
    return p


def scene(random, uniform=False, form=None, least=30, most=110):
    """Options of a random scene by name."""
    v = random.uniform(0.2, 1.5)
    form = form or ("continuum", "chain")[random.integers(2)]
    p = {"model_form": form, "model_v": v, "grid_n": int(random.integers(least, most))}
    ends = random.integers(5)
    kinds = ("free", "velocity")
    if ends:
        p["bc_left"], p["bc_right"] = kinds[(ends - 1) % 2], kinds[(ends - 1) // 2]
        for end in ("left", "right"):
            if p["bc_" + end] == "velocity":
                p[f"bc_{end}_value"] = v if uniform or random.random() < 0.3 else random.uniform(0.15, 1.6)
    p |= friction_of(random)
    if form == "chain":
        p |= {"model_m": random.uniform(0.5, 2), "model_k0": random.uniform(0.05, 1), "model_k1": random.uniform(0.05, 2),
              "model_f0": random.uniform(0.5, 2), "model_zeta": random.choice([0, random.uniform(0, 1)])}
    else:
        p |= {"model_gamma": random.uniform(0.4, 4), "model_c": random.uniform(0.5, 4),
              "model_delta": random.choice([0, random.uniform(0, 0.5)]), "grid_length": random.uniform(5, 60),
              "grid_order": int(random.choice([2, 4, 6, 8] if ends in (0, 1) else [2, 4, 6]))}
    if not uniform and random.random() < 0.7:
        p |= {"friction_spread": random.uniform(0.02, 0.5), "friction_seed": int(random.integers(1000))}
        if form == "continuum":
            p["friction_spread_length"] = random.uniform(0.3, 3)
    return p


def with_profiles(random, p):
    """A scene of a chain without held ends in which some of friction's parameters, or its amplitude, differ from block to
    block."""
    numbers = [name for name in p if name.startswith(("friction_", "state_")) and isinstance(p[name], float)]
    chosen = [name for name in numbers if random.random() < 0.6]
    p = p | {name: p[name] * random.uniform(0.7, 1.4, p["grid_n"]) for name in chosen}
    if not chosen or random.random() < 0.5:
        p["friction_amplitude"] = random.uniform(0.6, 1.5, p["grid_n"])
    return p
