"""Options of the commands, for CLI, TOML and records: defaults are stated here and nowhere else."""

from __future__ import annotations

import json
import shlex
import tomllib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import platformdirs
import tyro
from tyro.constructors import PrimitiveConstructorSpec

from ..fem.errors import InputError, UsageError
from ..fem.laws.law import LAWS
from ..fem.registry import Registry
from ..fem.scene import UpAxis
from ..fem.solve.method import SCENARIOS
from ..predictors.encoders import ENCODERS, check_encoder
from ..predictors.predictor import PREDICTORS
from .asset import Unit, path_of
from .meshing import AUTO, MESHERS, OR_PARTICLES, STUFFING

# What a stage of progress begins with that says how long a run will take: it is always shown.
EXPECTED = "expected: "
EVERY = "*"  # in place of a part's name, in options of walls
Names = Literal["symbols", "usd", "vomp", "pixie", "newton"]


def choice(registry: Registry, *others: str) -> PrimitiveConstructorSpec[str]:
    """Type of an option that takes a name of ``registry``: ``Annotated[str, choice(LAWS)]``."""
    names = (*others, *registry.names)
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar="{" + ",".join(names) + "}",
        instance_from_str=lambda words: words[0],
        is_instance=lambda value: isinstance(value, str),
        str_from_instance=lambda value: [value],
        choices=names,
    )


Repeated = tyro.conf.UseAppendAction
Flat = tyro.conf.OmitArgPrefixes
Output = Annotated[Path, tyro.conf.arg(aliases=("-o",))]


@dataclass(frozen=True)
class ConvertOptions:
    """How the asset becomes tetrahedra."""

    size: float | None = None
    """Longest side of the asset's bounding box [m]."""
    units: Unit | None = None
    """Unit of the file's numbers; what states none is taken as metres, with a warning."""
    up: UpAxis | None = None
    """Axis that points up, COLMAP's is -y; by default the format's (glTF and OBJ: y, others: z)."""
    opacity: float | None = None
    """Splats below this opacity are haze, no matter; by default .1."""
    crop: str | None = None
    """Splats within this box alone, x,y,z,x,y,z in the file's units."""
    mesher: Annotated[str, choice(MESHERS, AUTO, OR_PARTICLES)] = AUTO
    """ftetwild keeps epsilon; stuffing is quick, auto for samples, large scans, time-outs;
    particles, cubes for --solver mpm, are what `run` takes with it where no mesh can be had."""
    edge_length_rel: float | None = None
    """Wanted edge of a tet, share of the bounding box diagonal; .05, stuffing: 50,000 tets."""
    edge_length: float | None = None
    """Wanted edge of a tet [m]; replaces --edge-length-rel."""
    epsilon_rel: float = 2e-3
    """Largest distance between the result and the input surface, as a share of the diagonal."""
    max_tets: int | None = None
    """Budget of tets: edge and epsilon grow until it is met."""
    layers: int = 1
    """Layers of tets wanted through thin places; 2 took 4 times as long, with 10 times the tets."""
    thicken: float | None = None
    """Thickness [m] given to sheets; without it they are left out, with a warning."""
    time_limit: float = 300.0
    """CPU seconds that all attempts of the tetrahedraliser may take together."""
    keep: str | None = None
    """Loose pieces: all, largest, so many, or a least share; by default .005 of the volume."""
    fast: bool = False
    """End with the first body, a lattice in seconds, and do not wait for fTetWild."""
    accept_broken: bool = False
    """Keep the best mesh where none is within epsilon of the input, with warnings, not exit 4."""
    cache: Path | None = None
    """Folder that remembers results of the tetrahedraliser; by default the user's cache folder."""
    no_cache: tyro.conf.FlagCreatePairsOff[bool] = False
    """Compute again and remember nothing."""
    seed: int = 0
    """Seed of everything random of ours; the tetrahedraliser itself varies by 2-3 % in tets."""

    def loading(self) -> dict[str, Any]:
        """Return what ``load_asset`` takes."""
        names = ("size", "units", "up", "opacity", "crop")
        return {name: getattr(self, name) for name in names}

    def engine(self) -> dict[str, Any]:
        """Return the options of the tetrahedraliser; size, units and up belong to loading."""
        names = ("edge_length_rel", "edge_length", "epsilon_rel", "max_tets", "layers", "thicken")
        names += ("mesher", "time_limit", "accept_broken", "keep", "seed")
        cache = None if self.no_cache else self.cache or _cache_folder("convert")
        found = {name: getattr(self, name) for name in names} | {"cache": cache}
        return found | ({"mesher": STUFFING} if self.fast and self.mesher == AUTO else {})


@dataclass(frozen=True)
class WallOptions:
    """What closed parts are inside: solid, or a wall around something."""

    wall: float | None = None
    """Wall [m] of every closed part; by default what its kind of thing has, else it is solid."""
    part_wall: Annotated[tuple[str, ...], Repeated] = ()
    """Wall [m] of one part, NAME=METRES, or NAME=solid; may be repeated."""
    fill: Annotated[tuple[str, ...], Repeated] = ()
    """What walls hold: MATERIAL, or NAME=MATERIAL for one part; may be repeated."""
    solid: bool = False
    """Closed parts are solid, whatever they are called."""
    held: Annotated[tuple[str, ...], tyro.conf.Suppress] = ()
    """Parts whose walls the mesh has by itself: what a conversion found."""
    contents: Annotated[tuple[str, ...], tyro.conf.Suppress] = ()
    """Material of parts that are what walls hold, NAME=MATERIAL: what a conversion made."""

    def geometry(self) -> dict[str, Any]:
        """Return what the tetrahedraliser makes of it: walls [m] of parts that hold nothing."""
        walls, full = self.by_part(), self.fillings()
        hollow = {name: wall for name, wall in walls.items() if wall and EVERY not in full}
        return {
            "wall": None if EVERY in full or self.solid else self.wall,
            "part_wall": hollow,
            "solid": (
                *full,
                *self.held,
                *pairs(self.contents),
                *(name for name, wall in walls.items() if wall is None),
            ),
        }

    def wall_of(self, part: str) -> float | None:
        """Return the wall [m] that is said of a part, None where it is solid or nothing is said."""
        return self.by_part().get(part, None if self.solid else self.wall)

    def filling_of(self, part: str) -> str | None:
        """Return the material that a part is said to be full of."""
        full = self.fillings()
        return full.get(part, full.get(EVERY))

    def by_part(self) -> dict[str, float | None]:
        """Return the walls [m] of single parts, None for solid ones."""
        walls: dict[str, float | None] = {}
        for name, said in pairs(self.part_wall).items():
            try:
                walls[name] = None if said == "solid" else float(said)
            except ValueError as error:
                raise UsageError("options.wall", value=said) from error
        return walls

    def fillings(self) -> dict[str, str]:
        """Return the material that each part is full of; ``EVERY`` stands for all."""
        return pairs([said if "=" in said else f"{EVERY}={said}" for said in self.fill])


@dataclass(frozen=True)
class AssignOptions:
    """How words become materials."""

    part: Annotated[tuple[str, ...], Repeated] = ()
    """Text for one part alone, NAME="TEXT"; may be repeated."""
    material: Annotated[tuple[str, ...], Repeated] = ()
    """Exact table material of one part, NAME=MATERIAL; may be repeated."""
    set: Annotated[tuple[str, ...], Repeated] = ()
    """Numbers of one part, PART:E=2e9,nu=.3,rho=1100 [Pa, 1, kg/m^3]; may be repeated."""
    region: Annotated[tuple[str, ...], Repeated] = ()
    """Text for one region of a thing in one piece, N="TEXT", as `assign` numbers them."""
    at: Annotated[tuple[str, ...], Repeated] = ()
    """Text for the region at, or nearest to, a point [m] of the mesh: X,Y,Z="TEXT"."""
    table: Path | None = None
    """Your own materials beside the table's, .csv with its columns or .toml; yours win."""
    interpreter: str | None = None
    """Language model that reads the text: http://HOST/v1#MODEL; key: AUTOPHYX_INTERPRETER_KEY."""
    alpha: float | None = None
    """Where in the material's range of E: 0 soft, 0.5 the default, 1 stiff."""
    samples: int = 0
    """So many plausible materials of what words leave open: intervals of mass, sag, frequency."""
    cells: int = 64
    """Voxels along the longest side of the material field."""
    predictor: Annotated[str, choice(PREDICTORS)] = "film"
    """What words leave open: a network finds it (film, unipixie), or names do (retrieval)."""
    encoder: str | None = None
    """Image encoder that the network also hears: embedded, openclip or openclip:TAG."""
    strict: bool = False
    """Fail on what is a warning otherwise (exit 2), and outside a category's band (exit 5)."""

    def checked(self) -> AssignOptions:
        """Return itself, or say which name is unknown."""
        if self.predictor not in PREDICTORS:
            raise UsageError(PREDICTORS.unknown(self.predictor))
        if self.encoder is not None:
            check_encoder(self.encoder, speaks=True)
        return self


@dataclass(frozen=True)
class SimulateOptions:
    """How the result is loaded and solved."""

    scenario: Annotated[str, choice(SCENARIOS)] = "sag"
    """It stands, hangs, is blown at, poked, dropped, squeezed, rings, falls, spins or is torn."""
    solver: Literal["fem", "mpm", "spring", "lbs"] = "fem"
    """Finite elements; particles (MPM: flows, breaks); a spring network; a reduced body (LBS)."""
    grid: int = 64
    """Cells of MPM's grid along the longest side."""
    stiff: Literal["rigid", "stationary", "cap"] = "rigid"
    """What is too stiff for MPM's steps: rigid (held: still), all of it still, or softened."""
    matter: Annotated[tuple[str, ...], Repeated] = ()
    """Class of a part under MPM, PART=CLASS[,name=value]: "pot=brittle,tension=5e6"; repeatable."""
    damping: float = 0.0
    """Rate at which velocities fade under MPM [1/s]."""
    preset: Literal["physgaussian"] | None = None
    """A paper's settings of MPM instead of --grid, --stiff, --damping: 1 m of 25 cells, .1 ms."""
    threads: Literal[1, 2] = 1
    """Threads of MPM on a CPU."""
    basis: Literal["vector", "skinning"] = "vector"
    """What moves a reduced body: fields of vectors, or handles."""
    handles: int = 10
    """Handles of --basis skinning."""
    parameters: Path | None = None
    """What `match` fitted, .npz, for the same --solver: moduli of a reduced body, or springs."""
    parameters_alpha: float | None = None
    """Between the soft (0) and the stiff end (1) of `match --to-stiff`; by default 0.5."""
    anchors: int = 2048
    """Anchors of a spring network: masses in the body that springs join."""
    neighbours: int = 32
    """Anchors that each of them is joined with, the nearest in sight."""
    eta: float = 0.0
    """Weights of these neighbours: 0, all alike; 20, about the nearest 16 alone."""
    law: Annotated[str, choice(LAWS)] | None = None
    """Law of the material; by default linear at rest, and neo-Hookean where strains are large."""
    order: Literal[1, 2] | None = None
    """Order of the elements, 1 or 2; by default 2 (motions: 1) while affordable."""
    refine: float | None = None
    """Refine the mesh of a rest where its error is until the answer is within so many percent."""
    supports: Literal["base", "three-point", "free"] = "base"
    """Clamp the base, rest on three points (only rigid motion is stopped), or free (vibrations)."""
    fix: Annotated[tuple[str, ...], Repeated] = ()
    """Hold a place, not the base: "part:leg*", "plane:z<10mm", box:..., near:x,y,z,r [:xy]."""
    load: Annotated[tuple[str, ...], Repeated] = ()
    """Force [N] in total on a place, PLACE=fx,fy,fz: part:head=0,0,-10; may be repeated."""
    pressure: Annotated[tuple[str, ...], Repeated] = ()
    """Pressure [Pa] against the surface of a place, PLACE=p; may be repeated."""
    torque: Annotated[tuple[str, ...], Repeated] = ()
    """Torque [N m] in total on a place, PLACE=tx,ty,tz; may be repeated."""
    move: Annotated[tuple[str, ...], Repeated] = ()
    """Prescribed displacement [m] of a place, PLACE=dx,dy,dz, or PLACE:z=0,0,dz; repeatable."""
    body: Annotated[tuple[str, ...], Repeated] = ()
    """Another mesh in the scene, FILE or FILE=x,y,z: moved by so much [m]; repeatable."""
    obstacle: Annotated[tuple[str, ...], Repeated] = ()
    """Rigid obstacle of a motion: "plane:z<0", sphere:x,y,z,r, box:, capsule:; =vx,vy,vz moves."""
    self_contact: bool = True
    """Keep pieces, bodies and folds apart in a motion."""
    grain: Annotated[tuple[str, ...], Repeated] = ()
    """Way of the grain of a wooden part, part:NAME=x,y,z; by default along its longest axis."""
    scene: Path | None = None
    """TOML file of these and of gravity, gravity_dir; options add to it."""
    gravity: float | None = None
    """Acceleration of gravity [m/s^2], 0 for none; by default 9.81."""
    gravity_dir: str | None = None
    """Where gravity pulls to, x,y,z; by default against the up axis."""
    wind_speed: float = 10.0
    """Speed of the wind [m/s]."""
    poke_force: float = 10.0
    """Force of the finger [N]."""
    drop_height: float | None = None
    """Height of the fall [m]; by default half the size of the body."""
    squeeze_share: float = 0.1
    """How far the plates close, as a share of the body's width."""
    fall_height: float | None = None
    """Height of the fall [m]; by default the size of the body."""
    spin_rate: float = 1.0
    """Turns a second at the start [1/s]."""
    tear_share: float = 0.3
    """How far the grips part, as a share of the body's length."""
    modes: int = 6
    """Natural vibrations to find under `modal`."""
    device: Literal["cpu", "cuda"] = "cpu"
    """Where to solve."""
    budget: float | None = None
    """CPU seconds of a film of --drive: a coarse body and the method that fits; `film` takes 60."""
    seconds: float = 2.0
    """Length of that film [s]; what is over sooner is shown slower."""
    touch: tyro.conf.FlagCreatePairsOff[bool] = False
    """The page has a body to pull with mouse or finger; takes some seconds more."""


@dataclass(frozen=True)
class TransferOptions:
    """How a field meets its carrier."""

    scale: float | None = None
    """Metres per unit of TARGET; by default the mesh's own where TARGET is its asset, else 1."""
    cells: int = 64
    """Voxels along the longest side of the field that a mesh is turned into."""


@dataclass(frozen=True)
class ExportOptions:
    """What another program is told beside the mesh."""

    bins: int = 64
    """Most materials of a program that knows no material a tet (calculix, mujoco, usd, fenics)."""
    names: Names = "symbols"
    """What the arrays for gmsh are called: E, nu, rho, or the words of another program."""
    up: UpAxis | None = None
    """Axis against gravity; by default what the mesh's sidecar says, else z."""
    gravity: float = 9.81
    """Acceleration of gravity [m/s^2] in the scene."""
    order: Literal[1, 2] | None = None
    """Order of the elements of a CalculiX deck; by default 2 while `simulate` takes it too."""
    grain: Annotated[tuple[str, ...], Repeated] = ()
    """Way of the grain of a wooden part, part:NAME=x,y,z; by default along its longest axis."""


@dataclass(frozen=True)
class FeatureOptions:
    """How an asset is looked at."""

    encoder: Annotated[str, tyro.conf.arg(metavar="|".join(ENCODERS))] = "embedded"
    """Encoder of the pictures; openclip (the extra) takes weights too, as openclip:TAG."""
    cells: int = 64
    """Voxels along the longest side."""
    views: int = 15
    """Cameras on the upper hemisphere."""
    lower: int = 0
    """Further cameras below the horizon."""
    words: Annotated[tuple[str, ...], Repeated] = ()
    """Words for the parts, "leaf, trunk, pot": label every voxel; of several sets the best."""
    picture: Path | None = None
    """Picture to write too: .png, the features' principal components as colours."""
    cache: Path | None = None
    """Folder that remembers features; by default the user's cache folder."""
    no_cache: tyro.conf.FlagCreatePairsOff[bool] = False
    """Look again and remember nothing."""

    def checked(self) -> FeatureOptions:
        """Return itself, or say that the encoder is unknown."""
        check_encoder(self.encoder, speaks=bool(self.words))
        return self

    @property
    def memory(self) -> Path | None:
        """Folder of the remembered features, if any."""
        return None if self.no_cache else self.cache or _cache_folder("features")


@dataclass(frozen=True)
class BatchOptions:
    """Who does the rows of a batch, and what each row may use."""

    engine: Literal["local", "ray"] = "local"
    """Processes of this machine, or a Ray cluster (the extra `batch`)."""
    address: str | None = None
    """Address of a running Ray cluster; by default one is started here."""
    workers: int | None = None
    """Assets at a time; by default as many as there are cores."""
    time_limit: float = 1800.0
    """Seconds that one asset may take."""
    memory_limit: float = 8.0
    """Address space [GB] of each process of an asset; 2 is enough for small ones."""

    def checked(self) -> BatchOptions:
        """Return itself, or say what is out of range."""
        if self.workers is not None and self.workers < 1:
            raise UsageError(f"--workers must be at least 1, got {self.workers}")
        for name in ("time_limit", "memory_limit"):
            if not getattr(self, name) > 0:
                flag = name.replace("_", "-")
                raise UsageError(f"--{flag} must be > 0, got {getattr(self, name):g}")
        if self.address and self.engine != "ray":
            raise UsageError("--address names a Ray cluster: say --engine ray too")
        return self


@dataclass(frozen=True)
class Common:
    """What every command has."""

    config: Path | None = None
    """TOML file of options; what stands on the command line wins."""
    print_config: bool = False
    """Print the options as TOML, for --config, and do nothing."""
    json: bool = False
    """Print one JSON document on stdout; everything else goes to stderr."""
    verbose: Annotated[bool, tyro.conf.arg(aliases=("-v",))] = False
    """Say more."""
    quiet: Annotated[bool, tyro.conf.arg(aliases=("-q",))] = False
    """Say only errors."""
    traceback: bool = False
    """Show the Python traceback of an error."""


def pairs(options: Sequence[str]) -> dict[str, str]:
    """Split NAME=VALUE options; a wrong one is a ``UsageError``."""
    found = {}
    for option in options:
        name, equals, value = option.partition("=")
        if not (equals and name.strip() and value.strip()):
            raise UsageError(f'wanted NAME="VALUE", got {option!r}')
        found[name.strip()] = value.strip().strip('"')
    return found


def region_texts(options: AssignOptions) -> dict[int | tuple[float, float, float], str]:
    """Text of each region that is chosen by its number or by a point; else a ``UsageError``."""
    found: dict[int | tuple[float, float, float], str] = {}
    for number, text in pairs(options.region).items():
        if not number.isdecimal():
            raise UsageError(f"--region wants N=TEXT, a number of a region; got {number!r}")
        found[int(number)] = text
    for place, text in pairs(options.at).items():
        try:
            x, y, z = map(float, place.split(","))
        except ValueError as error:
            raise UsageError(f"--at wants X,Y,Z=TEXT, a point in metres; got {place!r}") from error
        found[x, y, z] = text
    return found


def _cache_folder(name: str) -> Path:
    return platformdirs.user_cache_path("autophyx-tet") / name


# A TOML file and the cells of a manifest become ordinary arguments, so that there is one parser and
# one set of messages. They stand first: the command line has the last word.

Options = TypeVar("Options")  # a dataclass of options
# What belongs to one call, not to a configuration.
_OF_THE_CALL = ("common", "output", "dry_run")
_OF_THE_MACHINE = ("cache", "no_cache")
_SHORT = {"field_output": "field", "target": "for"}  # names that the command line changes


def arguments(options: Mapping[str, Any]) -> list[str]:
    """Options by name as arguments: true is a flag, a list repeats its option."""
    found = []
    for name, value in options.items():
        flag = f"--{name.replace('_', '-')}"
        for item in value if isinstance(value, list | tuple) else [value]:
            if isinstance(item, dict):
                raise UsageError(f"{name}: wanted a value or a list, got a table")
            if item is True:
                found.append(flag)
            elif item is not False and item is not None:
                found.append(f"{flag}={item}")
    return found


def command_line(verb: str, *inputs: Any, options: Iterable[Any] = (), **given: Any) -> str:
    """The call of a verb as a shell reads it; of ``options`` what is not its default.

    Where results are remembered is left out: it changes no result.
    """
    said, words = [str(word) for word in inputs], []
    for group in options:
        for item in fields(group) if group is not None else ():
            value, name = getattr(group, item.name), _SHORT.get(item.name, item.name)
            if value == item.default or item.name in _OF_THE_MACHINE:
                continue
            turned_off = value is False
            words += arguments({f"no_{name}" if turned_off else name: turned_off or value})
    for word in [*words, *arguments(given)]:
        flag, equals, value = word.partition("=")
        # what starts with a dash would be taken for an option
        said += [flag, value] if equals and not value.startswith("-") else [word]
    return shlex.join(["autophyx-tet", verb, *said])


def read_config(path: Path) -> list[str]:
    """Arguments of a TOML file; tables only group.

    Raises InputError: Where the file cannot be read or is no TOML.
    """
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read the configuration {path}: {error}") from error
    flat: dict[str, Any] = {}
    for name, value in document.items():
        flat |= value if isinstance(value, dict) else {name: value}
    return arguments(flat)


def with_given(options: Options, given: Mapping[str, Any], *, verb: str) -> Options:
    """Return the options with those ``given`` by name, as a Python user writes them.

    A text that is given for a path becomes one.

    Raises UsageError: Where there is no such option.
    """
    known = [item.name for item in fields(options)]  # type: ignore
    for name in given:
        if name not in known:
            near = get_close_matches(name, known, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise UsageError(f"{verb} has no option {name!r}{hint}")
    paths = [item.name for item in fields(options) if "Path" in str(item.type)]  # type: ignore
    changed = {name: getattr(options, name) for name in paths} | dict(given)
    taken = {name: path_of(changed[name]) for name in paths}
    return replace(options, **changed | taken)  # type: ignore


def option_names(command: Any) -> set[str]:
    """Names that a configuration of a command may have, those of its groups too."""
    names = set()
    for item in fields(command):
        group = item.default_factory
        if is_dataclass(group):
            names |= option_names(group)
        elif "Positional" not in str(item.type) and item.name not in _OF_THE_CALL:
            names.add(_SHORT.get(item.name, item.name))
    return names


def with_config(command: list[str], known: Collection[str]) -> list[str]:
    """Put what the file of ``--config`` says behind the verb, before all other arguments.

    Raises UsageError: Where the file names an option that is not ``known``.
    """
    path = None
    for i, word in enumerate(command):
        if word == "--config" and i + 1 < len(command):
            path = command[i + 1]
        elif word.startswith("--config="):
            path = word.partition("=")[2]
    if path is None:
        return command
    given = read_config(Path(path))
    for word in given:
        name = word.removeprefix("--").partition("=")[0].replace("-", "_")
        if name not in known:
            near = get_close_matches(name, known, n=1)
            hint = f"did you mean {near[0]!r}?" if near else "--help-all lists them"
            raise UsageError(f"{path}: there is no option {name!r}: {hint}")
    return [command[0], *given, *command[1:]]


def config_text(command: Any) -> str:
    """The options of a command as TOML; one that has no value yet is a comment."""

    def lines(options: Any) -> Iterator[str]:
        for item in fields(options):
            value = getattr(options, item.name)
            if item.name in _OF_THE_CALL:
                continue
            if is_dataclass(value):
                yield from ("", f"# {type(value).__name__}", *lines(value))
            elif "Positional" not in str(item.type):
                name = _SHORT.get(item.name, item.name)
                yield f"# {name} =" if value is None else f"{name} = {_toml(value)}"

    return "\n".join(lines(command)) + "\n"


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_toml, value))}]"
    # control characters and quotes as JSON has them; all else as it is written
    return json.dumps(str(value), ensure_ascii=False).replace("\x7f", "\\u007f")
