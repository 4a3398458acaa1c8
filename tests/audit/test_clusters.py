"""Only what slides is advanced (stick_clusters): the events of whole steps in random scenes, until chaos parts the
two, and the means of long runs."""
import numpy as np

from calls import check, run, scene_file
from cluster_scenes import OFF, ON, catalogue, drawn_scene, events_alike


def test_events_of_random_scenes(scenes):
    alike = []  # where there are as many as are asked for
    for index, (given, loading) in scenes(lambda random: drawn_scene(random, 300, 10), salt=39, short=3):
        count, of = events_alike(given, loading)
        check(count >= min(5, of), f"scene {index}: {count} of {of} events: {given}")
        if of >= 20:
            alike.append(count)
    check(np.median(alike) >= 20, f"median of the events alike: {np.median(alike)}")


def test_means_of_long_runs():
    # Moments of events are far from normal: the means of six runs each, by their scatter.
    means = {OFF: [], ON: []}
    for seed in range(1, 7):
        for how, found in means.items():
            run(scene_file("catalogue") + f" -grid_n 100 -ts_max_time 4000 -init_seed {seed} -out_frames 2 -out_file m.h5" + how)
            e = catalogue("m.h5")
            late = e["begin"] > 1000
            found.append([late.sum(), e["moment"][late].sum(), (e["extent"][late] == 1).mean()])
    whole, own = (np.array(found) for found in means.values())
    error = np.sqrt((whole.var(0, ddof=1) + own.var(0, ddof=1)) / len(whole))
    check((np.abs(whole.mean(0) - own.mean(0)) < 4 * error).all(), f"{whole.mean(0)}, {own.mean(0)}, errors {error}")
