"""A good scenario and the ways to make it bad, each with what its refusal has to say."""

from __future__ import annotations

from typing import NamedTuple

HERD = """herds:
- name: people
  archetype: human
  count: 3
  place: {kind: grid, spacing_m: 1}
  speed_m_s: 1.3
"""
GOOD = "name: good\nduration_s: 2\n" + HERD  # count is line 6, place 7, speed 8


class Bad(NamedTuple):
    """A scenario made bad: `old` of the good one replaced by `new` (or `new` alone, when `old` is None)."""

    id: str
    old: str | None
    new: str
    says: tuple[str, ...]  # all of these are in the message


def more(text: str) -> tuple[str, str]:
    """Lines added at the end; they start at line 9."""
    return "speed_m_s: 1.3\n", "speed_m_s: 1.3\n" + text


def ground(text: str) -> tuple[str, str]:
    """The world's ground as a line 9."""
    return more(f"world: {{ground: {text}}}\n")


FLUIDS = "world:\n  fluids:\n"
BOMB = "a: &a [x,x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"{chr(98 + k)}: &{chr(98 + k)} [{','.join(['*' + chr(97 + k)] * 10)}]\n" for k in range(8)
)

POOL = "{fluid: water, surface_m: 1, area_m: {x: [0, 8], z: [0, 6]}}"


def pool(keys: str, *regions: str) -> tuple[str, str]:
    """A pool of 8 m by 6 m (and more regions), its surface with the keys given; `water` is line 12 or later."""
    listed = "".join(f"  - {region}\n" for region in (POOL, *regions))
    return more(f"{FLUIDS}{listed}  water: {{{keys}}}\n")


TABLE = [
    Bad("herd named like an array", "name: people", "name: position", ("scene.yaml:4", "'position'", "an array")),
    # the file itself
    Bad("empty", None, "", ("scene.yaml: is empty", "mapping")),
    Bad("only comments", None, "# nothing\n", ("scene.yaml: is empty",)),
    Bad("list at the top", None, "- name: x\n", ("scene.yaml:1: a list at the top",)),
    Bad("text at the top", None, "hello\n", ("scene.yaml:1: a str at the top",)),
    Bad("unclosed bracket", None, "name: [1, 2\n", ("scene.yaml:2: not valid YAML",)),
    Bad("tab", None, "name: x\nworld:\n\tground: 1\n", ("scene.yaml:3: not valid YAML", "'\\t'")),
    Bad("control character", None, "name: \x07\n", ("scene.yaml: not valid YAML", "character")),
    Bad("two documents", None, GOOD + "---\n" + GOOD, ("scene.yaml:9: a second document",)),
    Bad("alias bomb", None, BOMB, ("scene.yaml:5: more than 100,000 values (aliases expanded)",)),
    Bad("alias of itself", None, "name: &a [*a]\n", ("scene.yaml:1: alias *a contains itself",)),
    Bad("alias without anchor", None, "name: *nobody\n", ("scene.yaml:1: alias *nobody has no anchor",)),
    Bad("deep nesting", None, "name: " + "[" * 100 + "]" * 100, ("scene.yaml:1: nested deeper than 40",)),
    Bad("deep block nesting", None, "".join(" " * k + "a:\n" for k in range(60)), ("scene.yaml:41: nested deeper",)),
    Bad("too large", None, "# " + "x" * 1_000_100, ("at most 1,000,000 are read",)),
    Bad("too many values", None, "name: [" + "1," * 110_000 + "]\n", ("more than 100,000 values",)),
    Bad("code tag", None, "name: !!python/object/apply:os.system [ls]\n", ("scene.yaml:1: tag", "not allowed")),
    Bad("key that is a list", None, "? [a, b]\n: 1\n", ("scene.yaml:1: a key must be a name",)),
    Bad("key that is a number", None, "1: 2\n", ("scene.yaml:1: a key must be a name",)),
    Bad(
        "key twice", "duration_s: 2", "duration_s: 2\nduration_s: 3", ("scene.yaml:3: key 'duration_s' again", "line 2")
    ),
    Bad(
        "integer of 5000 digits",
        "count: 3",
        "count: " + "9" * 5000,
        ("scene.yaml:6: '999", "cannot be read as int"),
    ),
    # keys
    Bad(
        "unknown key",
        "duration_s",
        "sede: 3\nduration_s",
        ("scene.yaml:2 sede: unknown key", "did you mean 'seed'?"),
    ),
    Bad("unknown key in a herd", "count: 3", "cuont: 3", (":6 herds[0].cuont: unknown key", "did you mean 'count'?")),
    Bad(
        "wrong unit",
        "speed_m_s: 1.3",
        "speed_kmh: 5",
        (":8 herds[0].speed_kmh", "did you mean 'speed_m_s'?", "unit"),
    ),
    Bad("no unit", "speed_m_s: 1.3", "speed: 1.3", (":8 herds[0].speed", "did you mean 'speed_m_s'?")),
    Bad(
        "no unit in a place",
        "spacing_m: 1",
        "spacing: 1",
        (":7 herds[0].place.spacing", "did you mean 'spacing_m'?"),
    ),
    Bad(
        "same length twice",
        "spacing_m: 1",
        "spacing_m: 1, spacing_cm: 100",
        ("spacing_cm: the same as 'spacing_m'",),
    ),
    Bad("missing count", "  count: 3\n", "", ("scene.yaml:4 herds[0].count: missing; 'count' is needed",)),
    Bad("missing herds", HERD, "seed: 1\n", ("herds: missing; 'herds' is needed",)),
    # values
    Bad("NaN", "duration_s: 2", "duration_s: .nan", (":2 duration_s: nan: must be a finite number",)),
    Bad("infinity", "speed_m_s: 1.3", "speed_m_s: .inf", (":8 herds[0].speed_m_s: inf: must be a finite number",)),
    Bad("overflow", "speed_m_s: 1.3", "speed_m_s: 1e999", ("speed_m_s: inf: must be a finite number",)),
    Bad("negative count", "count: 3", "count: -3", (":6 herds[0].count: -3: must be greater than or equal to 1",)),
    Bad("fractional count", "count: 3", "count: 2.5", (":6 herds[0].count: 2.5: must be a valid integer",)),
    Bad("text for a number", "count: 3", "count: many", (":6 herds[0].count: 'many': must be a valid integer",)),
    Bad(
        "true for a number", "speed_m_s: 1.3", "speed_m_s: true", ("herds[0].speed_m_s: true: must be a valid number",)
    ),
    Bad("number in quotes", "speed_m_s: 1.3", "speed_m_s: '1.3'", ("speed_m_s: '1.3': must be a valid number",)),
    Bad("yes for true", *more("  arms_up: yes\n"), (":9 herds[0].arms_up: 'yes': must be a valid boolean",)),
    Bad(
        "a billion characters", "count: 3", "count: 1000000000", ("herds: 1,000,000,000 characters", "1,000,000", "GB")
    ),
    Bad("negative duration", "duration_s: 2", "duration_s: -1", (":2 duration_s: -1: must be greater than 0",)),
    Bad("rate too low", *more("rate_hz: 10\n"), (":9 rate_hz: 10: must be greater than or equal to 15",)),
    Bad("rate too high", *more("rate_hz: 1000\n"), (":9 rate_hz: 1000: must be less than or equal to 240",)),
    Bad("name with a slash", "name: good", "name: ../up", (":1 name: '../up': must be a name",)),
    Bad("unknown schedule", *more("schedule: mixd\n"), (":9 schedule: 'mixd': must be one of", "mean 'mixed'?")),
    Bad("unknown drag mesh", *more("drag: {mesh: skined}\n"), (":9 drag.mesh: 'skined'", "did you mean 'skinned'?")),
    Bad("text for a mapping", *more("drag: rigid\n"), (":9 drag: 'rigid': must be a mapping",)),
    Bad("herds as a mapping", "herds:\n- name", "herds:\n  name", ("herds: ", "must be a list")),
    Bad("no herds", HERD, "herds: []\n", (":3 herds: []: must have at least 1 item",)),
    Bad("unknown place", "kind: grid", "kind: gird", (":7 herds[0].place.kind: 'gird'", "did you mean 'grid'?")),
    Bad("place without kind", "kind: grid, ", "", (":7 herds[0].place: ", "needs kind")),
    Bad("three coordinates", "spacing_m: 1", "spacing_m: 1, center_m: [1, 2, 3]", ("center_m", "at most 2 items")),
    Bad("one coordinate", "spacing_m: 1", "spacing_m: 1, center_m: [1]", ("center_m[1]: missing",)),
    Bad("zero spacing", "spacing_m: 1", "spacing_m: 0", (":7 herds[0].place.spacing_m: 0: must be greater than 0",)),
    # exactly one of
    Bad("duration and frames", "duration_s: 2", "duration_s: 2\nframes: 5", ("exactly one of duration_s, frames",)),
    Bad("neither duration nor frames", "duration_s: 2\n", "", ("exactly one of duration_s, frames", "none is given")),
    Bad("no speed", "  speed_m_s: 1.3\n", "", (":4 herds[0]: exactly one of speed_m_s, velocity_m_s, waypoints",)),
    Bad("speed and velocity", *more("  velocity_m_s: [1, 0]\n"), ("both speed_m_s and velocity_m_s are given",)),
    Bad(
        "fluid and density",
        *more(FLUIDS + "  - {fluid: mud, density_kg_m3: 9, surface_m: 0}\n"),
        (":11 world.fluids[0]: exactly",),
    ),
    Bad("event of nothing", *more("events:\n- {at_s: 1}\n"), (":10 events[0]: exactly one of impulse_n_s",)),
    Bad(
        "event of two things",
        *more("events:\n- {at_s: 1, style: crouch, clip: jump}\n"),
        (":10 events[0]: exactly one of impulse_n_s", "style, clip", "both style and clip are given"),
    ),
    Bad(
        "fade of a push",
        *more("events:\n- {at_s: 1, velocity_m_s: [0, 1], fade_s: 1}\n"),
        ("events[0].fade_s: 1:",),
    ),
    Bad(
        "hold of a style",
        *more("events:\n- {at_s: 1, style: crouch, hold_s: 1}\n"),
        ("hold_s: 1: only a clip",),
    ),
    Bad(
        "negative fade",
        *more("events:\n- {at_s: 1, clip: jump, fade_s: -1}\n"),
        ("fade_s: -1: must be",),
    ),
    Bad(
        "hold of no time",
        *more("events:\n- {at_s: 1, clip: jump, hold_s: 0}\n"),
        ("hold_s: 0: must be",),
    ),
    Bad("clip of no name", *more("events:\n- {at_s: 1, clip: 3}\n"), ("events[0].clip: 3: must be a valid string",)),
    Bad(
        "style of no walk",
        *more("  styles: {slow: {idle: idle}}\n"),
        (":9 herds[0].styles.slow: style",),
    ),
    Bad("style called normal", *more("  styles: {normal: {walk: walk}}\n"), ("styles.normal: 'normal' is",)),
    Bad(
        "clip of two roles",
        *more("  styles: {slow: {walk: walk, step: walk}}\n"),
        (":9 herds[0].styles.slow: clip 'walk' is named both walk and step",),
    ),
    Bad(
        "unknown key in a style",
        *more("  styles: {slow: {wakl: walk}}\n"),
        (":9 herds[0].styles.slow.wakl: unknown key 'wakl' (did you mean 'walk'?)",),
    ),
    # between parts
    Bad(
        "name of two herds",
        *more(HERD.removeprefix("herds:\n")),
        (":9 herds[1].name: 'people' is the name of herds[0]",),
    ),
    Bad(
        "event for no herd",
        *more("events:\n- {at_s: 1, herds: [peple], velocity_m_s: [0, 1]}\n"),
        (":10 events[0].herds[0]", "mean 'people'?"),
    ),
    Bad(
        "event beyond the herd",
        *more("events:\n- {at_s: 1, characters: [3], velocity_m_s: [0, 1]}\n"),
        ("events[0].characters: 3", "has 3 characters (0 to 2)"),
    ),
    Bad(
        "negative character",
        *more("events:\n- {at_s: 1, characters: [-1], velocity_m_s: [0, 1]}\n"),
        ("characters[0]: -1: must be greater",),
    ),
    Bad(
        "event after the end",
        *more("events:\n- {at_s: 3, velocity_m_s: [0, 1]}\n"),
        (":10 events[0].at_s: 3.0 s is after the end", "2 s"),
    ),
    Bad(
        "picture after the end",
        *more("pictures: {at_s: [1, 20]}\n"),
        (":9 pictures.at_s[1]: 20 s is after the end",),
    ),
    Bad(
        "picture of no herd", *more("pictures: {follow: poeple}\n"), (":9 pictures.follow: 'poeple'", "mean 'people'?")
    ),
    Bad(
        "recording rate", *more("record: {rate_hz: 25}\n"), (":9 record.rate_hz: 25: must divide rate_hz 60", "30, 20")
    ),
    Bad(
        "overlapping fluids",
        *more(FLUIDS + "  - {fluid: mud, surface_m: 0}\n  - {fluid: goo, surface_m: 1}\n"),
        (":12 world.fluids[1]: overlaps world.fluids[0]", "priority"),
    ),
    Bad(
        "area inside out",
        *more(FLUIDS + "  - {fluid: mud, surface_m: 0, area_m: {x: [2, 1], z: [0, 1]}}\n"),
        ("area_m.x: [2.0, 1.0]",),
    ),
    Bad(
        "unknown fluid",
        *more(FLUIDS + "  - {fluid: watr, surface_m: 0}\n"),
        (":11 world.fluids[0].fluid: 'watr'", "mean 'water'?", "goo"),
    ),
    Bad(
        "no density",
        *more(FLUIDS + "  - {density_kg_m3: 0, surface_m: 0}\n"),
        (":11 world.fluids[0].density_kg_m3: 0: must be greater than or equal to 0.1",),
    ),
    Bad(
        "layer above the surface",
        *more(FLUIDS + "  - {fluid: water, surface_m: 0.5, layers: [{fluid: mud, top_m: 0.6}]}\n"),
        (":11 world.fluids[0].layers[0].top_m: 0.6: must be below the surface at 0.5 m",),
    ),
    Bad(
        "layers upside down",
        *more(
            FLUIDS + "  - {fluid: water, surface_m: 1, layers: [{fluid: mud, top_m: 0.2}, {fluid: goo, top_m: 0.3}]}\n"
        ),
        ("layers[1].top_m: 0.3: must be below the top of layers[0] at 0.2 m",),
    ),
    Bad(
        "unknown fluid of a layer",
        *more(FLUIDS + "  - {fluid: water, surface_m: 1, layers: [{fluid: mudd, top_m: 0.2}]}\n"),
        (":11 world.fluids[0].layers[0].fluid: 'mudd'", "mean 'mud'?"),
    ),
    Bad(
        "wave without length",
        *more(FLUIDS + "  - {fluid: water, surface_m: 1, waves: [{amplitude_m: 0.1}]}\n"),
        (":11 world.fluids[0].waves[0]: exactly one of wavelength_m, period_s", "none is given"),
    ),
    Bad(
        "wave that breaks",
        *more(FLUIDS + "  - {fluid: water, surface_m: 1, waves: [{amplitude_m: 0.5, wavelength_m: 3}]}\n"),
        ("waves[0].amplitude_m: 0.5: a wave of 3 m breaks above 0.214 m",),
    ),
    Bad(
        "wave too high for the depth",
        *more(
            FLUIDS + "  - {fluid: water, surface_m: 1, wave_depth_m: 0.5, waves: [{amplitude_m: 0.3, period_s: 3}]}\n"
        ),
        ("waves[0].amplitude_m: 0.3: in 0.5 m of water waves break above 0.195 m",),
    ),
    Bad(
        "depth of no waves",
        *more(FLUIDS + "  - {fluid: water, surface_m: 1, wave_depth_m: 0.5}\n"),
        ("wave_depth_m: 0.5: there are no waves here",),
    ),
    Bad(
        "unknown profile of a river",
        *more(FLUIDS + "  - {fluid: water, surface_m: 1, river: {speed_m_s: 1, width_m: 3, profile: parabola}}\n"),
        (":11 world.fluids[0].river.profile: 'parabola': must be one of parabolic, log",),
    ),
    Bad(
        "turbulence of still water",
        *more(FLUIDS + "  - {fluid: water, surface_m: 1, turbulence: {intensity_share: 0.1}}\n"),
        ("turbulence.intensity_share: 0.1: a share of a flow of 0; intensity_m_s",),
    ),
    Bad(
        "tension without buoyancy",
        *more(FLUIDS + "  - {fluid: water, surface_m: 1, surface_tension_n_m: 0.07}\n"),
        ("surface_tension_n_m: 0.07: shows in the weight on the feet only; world.buoyancy",),
    ),
    Bad(
        "rain of nothing",
        *more("events:\n- {at_s: 1, rain: {rate_hz: 0, impulse_n_s: 5}}\n"),
        (":10 events[0].rain.rate_hz: 0: must be greater than 0",),
    ),
    Bad(
        "ramp of no length",
        *more("world: {ground: {kind: ramp, start_m: 2, end_m: 2, drop_m: 1}}\n"),
        (":9 world.ground.end_m: 2.0: must be above start_m",),
    ),
    Bad(
        "too few points",
        "kind: grid, spacing_m: 1",
        "kind: list, points_m: [[0, 0]]",
        (":7 herds[0].place.points_m: 1 points for a count of 3",),
    ),
    Bad(
        "full disc",
        "count: 3\n  place: {kind: grid, spacing_m: 1}",
        "count: 99\n  place: {kind: poisson_disc, radius_m: 1, min_distance_m: 1}",
        (":7 herds[0].place.min_distance_m: 99 characters", "at most 8"),
    ),
    Bad(
        "mean outside",
        *more("  variation: {height: {kind: normal, mean: 2, sd: 0.1, max: 1.5}}\n"),
        (":9 herds[0].variation.height: mean 2.0",),
    ),
    Bad(
        "min above max",
        *more("  variation: {mass: {kind: uniform, min: 2, max: 1}}\n"),
        (":9 herds[0].variation.mass: min 2.0 is above",),
    ),
    # files
    Bad(
        "unknown archetype",
        "archetype: human",
        "archetype: humann",
        (":5 herds[0].archetype: 'humann'", "mean 'human'?"),
    ),
    Bad(
        "missing character file",
        "archetype: human",
        "archetype: gone.glb",
        (":5 herds[0].archetype: 'gone.glb': no such file", "gone.glb)"),
    ),
    Bad("missing rig", *more("  rig: gone.yaml\n"), (":9 herds[0].rig: 'gone.yaml': no such file",)),
    Bad("missing fluids file", *more("fluids: gone.yaml\n"), (":9 fluids: 'gone.yaml': no such file",)),
    Bad(
        "missing height map",
        *more("world: {ground: {kind: heightmap, file: gone.png, cell_m: 1, height_scale_m: 2}}\n"),
        (":9 world.ground.file: 'gone.png': no such file",),
    ),
    Bad(
        "height map of words",
        *more("world: {ground: {kind: heightmap, file: x.docx, cell_m: 1}}\n"),
        ("'x.docx': must be a .png",),
    ),
    Bad(
        "height map without cell",
        *more("world: {ground: {kind: heightmap, file: x.npy}}\n"),
        ("'cell_m' is needed",),
    ),
    # ground
    Bad("unknown ground", *ground("{kind: stair, count: 3}"), (":9 world.ground.kind: 'stair'", "mean 'stairs'?")),
    Bad("stairs without count", *ground("{kind: stairs}"), ("world.ground.count: missing",)),
    Bad("stairs of no step", *ground("{kind: stairs, count: 0}"), ("ground.count: 0: must be greater",)),
    Bad("tread too short", *ground("{kind: stairs, count: 3, tread_m: 0}"), ("ground.tread_m: 0: must be greater",)),
    Bad("landing backwards", *ground("{kind: stairs, count: 3, landing_m: -1}"), ("ground.landing_m: -1",)),
    Bad(
        "stretch too steep",
        *ground("{kind: slopes, stretches: [{length_m: 1, angle_deg: 3}, {length_m: 1, angle_deg: 70}]}"),
        (":9 world.ground.stretches[1].angle_deg: 70: must be less than or equal to 60",),
    ),
    Bad(
        "stretch of no length",
        *ground("{kind: slopes, stretches: [{length_m: 0, angle_deg: 3}]}"),
        ("ground.stretches[0].length_m: 0: must be greater than 0",),
    ),
    Bad("no stretches", *ground("{kind: slopes, stretches: []}"), ("ground.stretches: []: must have at least 1 item",)),
    Bad("no waves", *ground("{kind: sines, waves: []}"), ("ground.waves: []: must have at least 1 item",)),
    Bad(
        "wave of no length",
        *ground("{kind: sines, waves: [{amplitude_m: 1, wavelength_m: 0}]}"),
        ("ground.waves[0].wavelength_m: 0: must be greater",),
    ),
    Bad(
        "wave with a wrong key",
        *ground("{kind: sines, waves: [{amplitude: 1, wavelength_m: 3}]}"),
        ("ground.waves[0].amplitude: unknown key", "mean 'amplitude_m'?"),
    ),
    Bad(
        "too much rubble",
        *ground("{kind: rubble, extent_m: [10000, 10000]}"),
        ("ground.extent_m: 625,000,000 cells of 0.4 m; at most 16,000,000",),
    ),
    Bad("no layers", *ground("{kind: layers, layers: []}"), ("ground.layers: []: must have at least 1 item",)),
    Bad(
        "layers with holes",
        *ground("{kind: layers, layers: [{kind: flat, area_m: {x: [0, 1], z: [0, 1]}}]}"),
        (":9 world.ground.layers: every layer has an area_m", "ground everywhere"),
    ),
    Bad(
        "layers in layers",
        *ground("{kind: layers, layers: [{kind: layers, layers: [{kind: flat}]}]}"),
        ("ground.layers[0].kind: 'layers': must be one of flat",),
    ),
    Bad(
        "layer inside out",
        *ground("{kind: layers, layers: [{kind: flat}, {kind: flat, area_m: {x: [2, 1], z: [0, 1]}}]}"),
        ("ground.layers[1].area_m.x: [2.0, 1.0]: the first must be below the second",),
    ),
    Bad(
        "area without layers",
        *ground("{kind: flat, area_m: {x: [0, 1], z: [0, 1]}}"),
        ("ground.area_m: a rectangle is for a layer",),
    ),
    Bad("missing mesh", *ground("{kind: mesh, file: gone.obj}"), (":9 world.ground.file: 'gone.obj': no such file",)),
    Bad("mesh of words", *ground("{kind: mesh, file: a.docx}"), ("'a.docx': must be a .obj, .ply",)),
    Bad(
        "missing mesh in a layer",
        *ground("{kind: layers, layers: [{kind: flat}, {kind: mesh, file: gone.obj}]}"),
        ("world.ground.layers[1].file: 'gone.obj': no such file",),
    ),
    Bad(
        "package that is not there",
        *ground("{kind: heightmap, file: 'package:nothing_here/a.npy', cell_m: 1}"),
        ("ground.file: 'package:nothing_here/a.npy': no package 'nothing_here' is installed",),
    ),
    Bad(
        "package without the file",
        *ground("{kind: heightmap, file: 'package:matplotlib/a.npy', cell_m: 1}"),
        ("package 'matplotlib' has no file 'a.npy'",),
    ),
    Bad(
        "way out of a package",
        *ground("{kind: heightmap, file: 'package:matplotlib/../numpy/a.npy', cell_m: 1}"),
        ("leads out of the package",),
    ),
    Bad(
        "three cells",
        *ground("{kind: heightmap, file: x.npy, cell_m: [1, 2, 3]}"),
        ("world.ground.cell_m",),
    ),
    Bad("slope limit of a wall", *more("world: {max_slope_deg: 90}\n"), (":9 world.max_slope_deg: 90: must be less",)),
    Bad("no step height", *more("world: {max_step_height_m: 0}\n"), ("max_step_height_m: 0: must be greater",)),
    Bad(
        "name no file can have",
        "archetype: human",
        'archetype: "\\0.glb"',
        (":5 herds[0].archetype", "no such file"),
    ),
    # a water surface
    Bad("water without fluid", *more("world: {water: {}}\n"), ("world.water.region: 0: no fluid there", "name one")),
    Bad("water of no region", *pool("region: 1"), (":12 world.water.region: 1: no fluid there", "regions 0 to 0")),
    Bad("water everywhere", *more(FLUIDS + "  - {fluid: water, surface_m: 1}\n  water: {}\n"), ("area_m is needed",)),
    Bad("water cell", *pool("cell_m: 0.35"), ("cell_m: 0.35: does not fit into x of 8 m", "0.3478 would")),
    Bad("water beyond its pool", *pool("area_m: {x: [-2, 6], z: [0, 6]}"), ("area_m.x: [-2, 6]: no fluid there",)),
    Bad("water area turned round", *pool("area_m: {x: [6, 2], z: [0, 6]}"), ("the first must be below the second",)),
    Bad("water too fine", *pool("cell_m: 0.01"), ("cell_m",)),
    Bad(
        "water of too many cells",
        *more(FLUIDS + "  - {fluid: water, surface_m: 1, area_m: {x: [0, 800], z: [0, 800]}}\n  water: {}\n"),
        ("64,000,000 cells, at most 262,144", "1.56 m"),
    ),
    Bad("water of too few cells", *pool("cell_m: 1"), ("8 cells along x, at least 16",)),
    Bad("water all border", *pool("border_m: 3"), ("border_m: 3: two borders fill z of 6 m",)),
    Bad(
        "water under other fluid",
        *pool("region: 0", "{fluid: mud, surface_m: 2, area_m: {x: [0, 2], z: [0, 2]}, priority: 1}"),
        ("world.fluids[1] lies over",),
    ),
    Bad("water strength", *pool("strength: -1"), ("world.water.strength", "-1")),
    Bad("water key", *pool("feedbak: true"), ("feedbak: unknown key", "feedback")),
    # responses
    Bad("load of nothing", *more("  load: {mass_kg: 0}\n"), (":9 herds[0].load.mass_kg: 0: must be greater than 0",)),
    Bad(
        "load at two heights",
        *more("  load: {mass_kg: 9, height_m: 1.2, height_share: 0.7}\n"),
        (":9 herds[0].load.height_share: 0.7: 'height_m' says where already",),
    ),
    Bad(
        "load on both sides",
        *more("  load: {mass_kg: 9, behind_m: 0.2, forward_m: 0.2}\n"),
        (":9 herds[0].load.forward_m: 0.2: 'behind_m' says where already",),
    ),
    Bad("load key", *more("  load: {mas_kg: 9}\n"), ("load.mas_kg: unknown key 'mas_kg' (did you mean 'mass_kg'?",)),
    Bad(
        "nobody has a load",
        *more("events:\n- {at_s: 1, load: pick_up}\n"),
        (":10 events[0].load: 'pick_up': nobody there has a load (herds: people)",),
    ),
    Bad("load thrown", *more("events:\n- {at_s: 1, load: throw}\n"), (":10 events[0].load: 'throw': must be",)),
    Bad(
        "stops before it walks",
        *more("  responses: {transitions: {walk_below_m_s: 1, stop_below_m_s: 1.5}}\n"),
        (":9 herds[0].responses.transitions.stop_below_m_s: 1.5: must be below walk_below_m_s 1",),
    ),
    Bad(
        "no hysteresis", *more("  responses: {transitions: {hysteresis: 0}}\n"), ("transitions.hysteresis: 0: must be",)
    ),
    Bad("reaction", *more("  responses: {reaction_s: 0}\n"), (":9 herds[0].responses.reaction_s: 0: must be",)),
    Bad(
        "arms up and down",
        *more("  arms_up: false\n  responses: {arms: {}}\n"),
        (":10 herds[0].responses.arms: arms of this herd stay down",),
    ),
    Bad("elbow", *more("  responses: {arms: {most_elbow_deg: 180}}\n"), ("arms.most_elbow_deg: 180: must be",)),
    Bad("response", *more("  responses: {transition: {}}\n"), ("unknown key 'transition' (did you mean",)),
    # levels of detail
    Bad("no detail", *more("  detail: {}\n"), (":9 herds[0].detail.triangles: missing", "(or mesh or every)")),
    Bad(
        "detail key",
        *more("  detail: {triangls: 200, every: 2}\n"),
        (":9 herds[0].detail.triangls: unknown key 'triangls' (did you mean 'triangles'?)", "calm_m_s2"),
    ),
    Bad("too few triangles", *more("  detail: {triangles: 12}\n"), ("detail.triangles: 12: must be greater",)),
    Bad("detail mesh", *more("  detail: {mesh: skined}\n"), (":9 herds[0].detail.mesh: 'skined'", "'skinned'?")),
    Bad("never stepped", *more("  detail: {every: 0}\n"), ("detail.every: 0: must be greater",)),
    Bad("half steps", *more("  detail: {every: 1.5}\n"), ("detail.every: 1.5",)),
    Bad(
        "steps too long",
        *more("  detail: {every: 4}\nrate_hz: 30\n"),
        (":9 herds[0].detail.every: 4: of 30 frames per second; at least 15 steps are needed (at most 2)",),
    ),
    Bad("far from where", *more("  detail: {every: 2, far_m: 30}\n"), ("detail.far_m: 'from_m' is needed too",)),
    Bad("where from", *more("  detail: {every: 2, from_m: [0, 0]}\n"), ("detail.from_m: 'far_m' is needed too",)),
    Bad("no unit in far", *more("  detail: {every: 2, far: 30}\n"), ("detail.far", "did you mean 'far_m'?")),
    Bad(
        "calm but exact",
        *more("  detail: {mesh: rigid, calm_m_s2: 0.5}\n"),
        ("detail.calm_m_s2: says which characters `every` slows down",),
    ),
    Bad(
        "fewer triangles with a belt",
        *more("  belt: true\n  detail: {triangles: 200}\n"),
        (":10 herds[0].detail.triangles: 200: a belt is all triangles",),
    ),
    Bad(
        "slow in moving water",
        "speed_m_s: 1.3\n",
        f"speed_m_s: 1.3\n  detail: {{every: 2}}\n{FLUIDS}  - {POOL}\n  water: {{}}\n",
        (":9 herds[0].detail.every: 2: characters meet in `world.water` every frame",),
    ),
]
