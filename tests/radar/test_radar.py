"""Placement, detection, miss ratio (5) and the bank, against naive twins and simulations in NumPy."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import numpy_model
import pytest
from compiling import nothing_compiles
from scipy import stats
from significance import ALPHA, means_differ, p_of, same_law, z

from jrcjax import radar
from jrcjax.model import slot
from jrcjax.radar import detection, modes, placement
from jrcjax.radar.placement import Footprints
from jrcjax.readings import CountingRule, CountModel, Distance

READINGS = [(distance, rule) for distance in Distance.names() for rule in CountingRule.names()]
CAPACITY = 320  # of the footprints in most of the tests
LONG, SHORT = 0, 1

detect = jax.jit(detection.detected_objects)


def small_radar(**changes):
    """Two modes of about 24 and 6 objects, quick to place; all of one shape, so that they compile once."""
    described = {
        "bandwidth": (3e8, 7.5e8), "slope": (1e13, 1.5e13), "max_intermediate_frequency": (3e6, 2.25e6),
        "class_share": (0.75, 0.25), "size_mean": ((2.0, 1.5), (0.7, 0.7)), "size_std": ((0.2, 0.1), (0.1, 0.1)),
        "density": 24.0, "max_density": 60.0, "bank_size": 4096,
    }  # fmt: skip
    return radar.make_radar(**(described | changes))


def random_objects(rng, count, side):
    """Centres and sizes as float32; some objects lie exactly on one another."""
    centre = rng.uniform((0, -side / 2), (side, side / 2), (count, 2)).astype(np.float32)
    size = np.abs(rng.normal((4.6, 1.9), (2.0, 0.5), (count, 2))).astype(np.float32)
    if count > 20:
        centre[-2:] = centre[:2]
    return centre, size


def padded(rng, centre, size, capacity):
    """Footprints in random places of `capacity` slots; whatever is in the other slots must not matter."""
    where = rng.permutation(capacity)[: len(centre)]
    all_centre = rng.uniform(-30.0, 30.0, (capacity, 2)).astype(np.float32)
    all_size = rng.uniform(0.0, 50.0, (capacity, 2)).astype(np.float32)
    present = np.zeros(capacity, bool)
    all_centre[where], all_size[where], present[where] = centre, size, True
    return Footprints(jnp.asarray(all_centre), jnp.asarray(all_size), jnp.asarray(present))


def assert_counts_agree(footprints, resolution, distance, rule, rounding):
    """Compares with the twin; returns whether no gap was too close to the resolution to tell.

    The twin counts at a resolution smaller and larger by the rounding of a float32 coordinate: where both agree, no
    gap is a near tie and the count must be exactly theirs.
    """
    got = int(detect(footprints, jnp.float32(resolution), Distance[distance.upper()], CountingRule[rule.upper()]))
    present = np.asarray(footprints.present)
    gap = numpy_model.gaps(footprints.centre[present], footprints.size[present], distance)
    most, least = (numpy_model.detected(gap, np.float32(resolution) + d, rule) for d in (-rounding, rounding))
    assert least <= got <= most
    return least == most


@pytest.mark.parametrize(("distance", "rule"), READINGS)
def test_detected_objects_against_pairs(distance, rule):
    rng = np.random.default_rng(1)
    clear = []
    for count in (0, 1, 2, 3, 5, 9, 17, 33, 64, 65, 128, 200, 319, 320):
        for side, resolution in ((45.0, 0.2), (120.0, 0.5), (12.0, 2.0)):
            footprints = padded(rng, *random_objects(rng, count, side), CAPACITY)
            rounding = 4 * np.spacing(np.float32(side))
            clear.append(assert_counts_agree(footprints, resolution, distance, rule, rounding))
    # A test of mostly near ties would show nothing.
    assert np.mean(clear) > 0.75


@pytest.mark.parametrize(("distance", "rule"), READINGS)
def test_detected_objects_of_the_densest_long_range_slot(distance, rule):
    rng = np.random.default_rng(2)
    footprints = padded(rng, *random_objects(rng, 1350, 225.0), 1652)
    resolution = 0.05 if distance == "radial_range" else 0.5  # at 0.5 m all radial ranges merge
    assert_counts_agree(footprints, resolution, distance, rule, 4 * np.spacing(np.float32(225.0)))


def test_twin_agrees_with_plain_loops():
    centre, size = random_objects(np.random.default_rng(3), 60, 45.0)
    expected = numpy_model.detected_by_loops(centre.tolist(), size.tolist(), 0.5)
    assert numpy_model.detected(numpy_model.gaps(centre, size, "footprint_gap"), 0.5, "resolved") == expected


# Two rectangles of 4 m x 2 m side by side, a third far away: the gap between the first two is 1 m.
@pytest.mark.parametrize(("distance", "rule", "resolution", "expected"), [
    ("footprint_gap", "resolved", 0.9, 3), ("footprint_gap", "resolved", 1.1, 1), ("footprint_gap", "clusters", 1.1, 2),
    ("centre_to_centre", "resolved", 2.9, 3), ("centre_to_centre", "resolved", 3.1, 1),
    ("radial_range", "resolved", 0.4, 3), ("radial_range", "resolved", 0.5, 1), ("radial_range", "clusters", 0.5, 2),
])  # fmt: skip
def test_readings_by_hand(distance, rule, resolution, expected):
    # Radial ranges 10, hypot(10, 3) = 10.44 and 40.
    centre = jnp.asarray([[10.0, 0.0], [10.0, 3.0], [40.0, 0.0]])
    footprints = Footprints(centre, jnp.full((3, 2), jnp.asarray([4.0, 2.0])), jnp.ones(3, bool))
    got = detect(footprints, jnp.float32(resolution), Distance[distance.upper()], CountingRule[rule.upper()])
    assert int(got) == expected


def test_gap_equal_to_the_resolution_is_not_resolved():
    # Two objects are told apart if their distance is more than the resolution.
    centre = jnp.asarray([[10.0, 0.0], [12.0, 0.0]])
    footprints = Footprints(centre, jnp.ones((2, 2)), jnp.ones(2, bool))
    assert int(detect(footprints, jnp.float32(1.0), 0, 0)) == 0
    assert int(detect(footprints, jnp.float32(0.999), 0, 0)) == 2


def test_chain_of_objects_is_one_cluster():
    order = np.random.default_rng(4).permutation(200)
    centre = jnp.asarray(np.column_stack([order * 1.0, np.zeros(200)]), jnp.float32)
    footprints = Footprints(centre, jnp.full((200, 2), 0.5), jnp.ones(200, bool))
    assert int(detect(footprints, jnp.float32(0.6), 0, 1)) == 1
    assert int(detect(footprints, jnp.float32(0.6), 0, 0)) == 0
    assert int(detect(footprints, jnp.float32(0.4), 0, 1)) == 200


def test_miss_ratio_of_counts(strict):
    ratios = detection.miss_ratio(jnp.asarray([27, 27, 27, 0]), jnp.asarray([27, 18, 0, 0]))
    np.testing.assert_allclose(ratios, [0.0, 1 / 3, 1.0, 0.0], rtol=1e-6)


def test_fixed_counts(target, source):
    np.testing.assert_array_equal(np.round(modes.mean_count(target.radar)), [675, 27])
    np.testing.assert_array_equal(np.round(modes.mean_count(source.radar)), [1350, 54])
    for omega in range(1, 55):
        means = modes.mean_count(target.radar.modes.replace(density=omega))
        counts = [int(placement.object_count(jax.random.key(0), mean, CountModel.FIXED)) for mean in means]
        assert counts == [25 * omega, omega]


def test_poisson_counts():
    draw = jax.jit(jax.vmap(placement.object_count, in_axes=(0, None, None)))
    for seed, mean in enumerate((0.7, 27.0, 675.0)):
        counts = np.asarray(draw(jax.random.split(jax.random.key(seed), 20_000), jnp.float32(mean), CountModel.POISSON))
        # Index of dispersion, and the mean through the sum, itself a Poisson number.
        dispersion = ((counts - counts.mean()) ** 2).sum() / counts.mean()
        freedom = len(counts) - 1
        assert 2 * min(stats.chi2.cdf(dispersion, freedom), stats.chi2.sf(dispersion, freedom)) > ALPHA
        assert z((counts.sum() - len(counts) * mean) / np.sqrt(len(counts) * mean)) > ALPHA


def test_cars_and_pedestrians(target):
    classes = target.radar.classes
    place = jax.jit(jax.vmap(lambda key: placement.place_objects(key, 27, jnp.float32(45.0), classes, capacity=40)))
    placed = jax.tree.map(np.asarray, place(jax.random.split(jax.random.key(5), 4000)))
    np.testing.assert_array_equal(placed.present.sum(axis=1), 27)
    centre, size = placed.centre[placed.present], placed.size[placed.present]
    cars = size[:, 0] > 2.5  # ten standard deviations from either class
    np.testing.assert_array_equal(cars.reshape(-1, 27).sum(axis=1), 20)
    for kind, (length, width) in ((cars, ((4.62, 0.18), (1.92, 0.08))), (~cars, ((0.73, 0.085), (0.68, 0.055)))):
        assert stats.kstest(size[kind, 0], stats.norm(*length).cdf).pvalue > ALPHA
        assert stats.kstest(size[kind, 1], stats.norm(*width).cdf).pvalue > ALPHA
        assert z(stats.pearsonr(*size[kind].T)[0] * np.sqrt(kind.sum())) > ALPHA
    # Uniform in the square in front of the vehicle, and the two coordinates independent.
    assert stats.kstest(centre[:, 0], stats.uniform(0.0, 45.0).cdf).pvalue > ALPHA
    assert stats.kstest(centre[:, 1], stats.uniform(-22.5, 45.0).cdf).pvalue > ALPHA
    assert z(stats.pearsonr(*centre.T)[0] * np.sqrt(len(centre))) > ALPHA


@pytest.mark.slow
def test_larger_capacity_changes_nothing():
    keys = jax.random.split(jax.random.key(6), 64)
    start = small_radar()
    ratios = []
    for extra in (0, 57):  # in all, on both sides of a power of two
        larger = start.modes.replace(max_objects=tuple(n + extra for n in start.max_objects))
        ratios.append(jax.jit(jax.vmap(lambda key, m=larger: modes.fresh_miss_ratio(key, LONG, m)))(keys))
    assert len(np.unique(ratios[0])) > 3
    np.testing.assert_array_equal(*ratios)


def test_density_and_mode_as_axes():
    start, key = small_radar(), jax.random.key(7)
    densities, of_modes = [6.0, 24.0, 60.0, 24.0, 60.0], [LONG, LONG, LONG, SHORT, SHORT]
    together = jax.jit(jax.vmap(lambda density, mode: radar.miss_ratio(key, density, mode, radar=start)))(
        jnp.asarray(densities), jnp.asarray(of_modes)
    )
    one_by_one = [radar.miss_ratio(key, d, mode, radar=start) for d, mode in zip(densities, of_modes, strict=True)]
    assert len(np.unique(together)) > 2
    np.testing.assert_array_equal(together, one_by_one)


@pytest.mark.slow
@pytest.mark.parametrize("mode", [LONG, SHORT])
def test_mean_miss_ratio_against_a_simulation(mode):
    reach, resolution, placements = ((225.0, 0.5, 25), (45.0, 0.2, 3000))[mode]
    rng = np.random.default_rng(9)
    for omega in (8.0, 16.0, 27.0, 40.0, 54.0):
        bank = np.asarray(radar.paper_radar(omega).miss_bank[mode])
        simulated = numpy_model.simulated_miss_ratios(rng, omega, reach, resolution, placements)
        assert means_differ(bank, simulated) > ALPHA
        if mode == SHORT:
            missed = [np.bincount(np.rint(r * omega).astype(int), minlength=int(omega) + 1) for r in (bank, simulated)]
            assert same_law(*missed) > ALPHA


def test_bank_holds_ratios(any_params):
    bank = np.asarray(any_params.radar.miss_bank)
    assert ((bank >= 0) & (bank <= 1)).all()


def test_paper_banks_hold_thousands(target, source):
    assert target.radar.miss_bank.shape[1] >= 4096
    assert source.radar.miss_bank.shape[1] >= 4096


def test_short_range_misses_less(target, source):
    for params in (target, source):
        long, short = params.radar.miss_bank
        assert p_of(stats.ttest_ind(long, short, equal_var=False, alternative="greater")) < ALPHA


_miss_ratios = jax.jit(
    jax.vmap(
        lambda words, action, params: slot.run_slot(words, 0, action, params, 0).miss_ratio, in_axes=(0, None, None)
    )
)


def _slot_miss_ratios(params, action, count, seed):
    words = jax.random.bits(jax.random.key(seed), (count, slot.NUM_WORDS), jnp.uint32)
    return np.asarray(_miss_ratios(words, jnp.int32(action), params))


@pytest.mark.parametrize("changes", [{}, {"count_model": "poisson", "counting_rule": "clusters"}], ids=len)
def test_bank_and_fresh_placements_have_one_law(target, changes):
    banked = target.replace(radar=small_radar(**changes))
    fresh = target.replace(radar=banked.radar.replace(placements="fresh"))
    for mode in (LONG, SHORT):
        action = target.num_rates + mode
        bank = np.asarray(banked.radar.miss_bank[mode])
        from_slots = _slot_miss_ratios(fresh, action, 4096, seed=10 + mode)
        # Slots through the bank: each placement equally often. Slots with fresh ones: the law of the bank.
        from_bank = _slot_miss_ratios(banked, action, 100_000, seed=20 + mode)
        values, inverse = np.unique(np.concatenate([bank, from_bank, from_slots]), return_inverse=True)
        counts = [np.bincount(part, minlength=len(values)) for part in np.split(inverse, [4096, 104_096])]
        assert len(values) > 3
        assert same_law(counts[0], counts[2]) > ALPHA
        share = counts[0] / 4096
        assert (counts[1][share == 0] == 0).all()
        expected = (share * 100_000)[share > 0]
        assert stats.chisquare(counts[1][share > 0], expected).pvalue > ALPHA


def test_bank_entries_are_independent():
    bank = np.asarray(small_radar().miss_bank)
    for first, second in ((bank[0, :-1], bank[0, 1:]), (bank[1, :-1], bank[1, 1:]), (bank[0], bank[1])):
        assert z(stats.pearsonr(first, second)[0] * np.sqrt(len(first))) > ALPHA


def test_bank_seed_decides():
    first, again, other = (small_radar(bank_seed=seed).miss_bank for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


def test_replace_builds_the_bank_anew():
    start = small_radar()
    for density in (12.0, 48.0):
        changed = start.replace(density=density)
        np.testing.assert_array_equal(changed.miss_bank, small_radar(density=density).miss_bank)
        np.testing.assert_array_equal(dataclasses.replace(start, density=density).miss_bank, changed.miss_bank)
    for field, value in (
        ("counting_rule", 1),
        ("distance", "radial_range"),
        ("count_model", "poisson"),
        ("bank_seed", 5),
    ):
        assert (start.replace(**{field: value}).miss_bank != start.miss_bank).any(), field
    assert (start.replace(size_mean=2.0 * start.size_mean).miss_bank != start.miss_bank).any()
    assert (start.replace(bandwidth=0.1 * start.bandwidth).miss_bank != start.miss_bank).any()
    assert start.replace(bank_size=32).miss_bank.shape == (2, 32)
    np.testing.assert_array_equal(start.replace(placements="fresh").miss_bank, start.miss_bank)


def test_a_bank_is_made_once_for_the_same_numbers():
    before = small_radar()
    with nothing_compiles():
        again = small_radar().replace(placements="fresh")
    assert again.miss_bank is before.miss_bank


def test_a_bank_cannot_be_set():
    with pytest.raises(ValueError, match="miss_bank"):
        small_radar().replace(miss_bank=jnp.zeros((2, 4096)))
    with pytest.raises(ValueError, match="miss_bank"):
        dataclasses.replace(small_radar(), miss_bank=jnp.zeros((2, 4096)))


@pytest.mark.slow
def test_replace_inside_vmap():
    start = small_radar()
    densities = jnp.asarray([6.0, 24.0, 60.0, 240.0])
    banks = jax.vmap(lambda density: start.replace(density=density).miss_bank)(densities)
    one_by_one = [start.replace(density=density).miss_bank for density in densities[:3]]
    np.testing.assert_array_equal(banks[:3], one_by_one)
    assert (np.diff(banks[:3].mean(axis=-1), axis=0) > 0).all()
    # More objects than there are slots for must not look like a result.
    assert np.isnan(banks[3]).all()


@pytest.mark.slow
def test_replace_makes_room_for_more_objects():
    start = small_radar(bank_size=8)
    dense = start.replace(density=jnp.float32(240.0))
    assert all(b > a for a, b in zip(start.max_objects, dense.max_objects, strict=True))
    assert np.isfinite(dense.miss_bank).all()


def test_preset_bank_is_the_same_in_a_trace(target):
    miss = jax.jit(lambda params: params.radar.miss_bank)(target)
    np.testing.assert_array_equal(miss, target.radar.miss_bank)


def test_resolution_limit():
    # Infinitely fine resolution misses only what overlaps; none at all merges everything.
    fine = small_radar(bandwidth=(1e14, 1e14), size_mean=((1e-3, 1e-3),) * 2, size_std=((0.0, 0.0),) * 2)
    coarse = small_radar(bandwidth=(1e5, 1e5))
    assert float(fine.miss_bank.max()) == 0.0
    assert float(coarse.miss_bank.min()) == 1.0


def test_mean_of_the_bank(target):
    expected = np.asarray(target.radar.miss_bank, np.float64).mean(axis=1)
    np.testing.assert_allclose(radar.mean_miss_ratio(target.radar), expected, rtol=1e-5)
