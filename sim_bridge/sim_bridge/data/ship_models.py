"""Make what comes with cfnav of the furniture of sweethome3d-furniture, and the pages of credits.

``python -m sim_bridge.data.ship_models`` writes the archive of models in the public domain, which
``cc0.*`` rooms are furnished with, its NOTICE, and a page that says whom to name for all models of
the table. Run it again when the table or the package changes; ``CC0_VERSION`` rises with it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from cfnav_core.command import run_options
from cfnav_core.files.whole import whole, write_file
from sim_bridge.sweet_home.catalogue import SHIPPED, catalogue
from sim_bridge.sweet_home.licences import CC0, CC_BY, CC_BY_US, URIS, Credit, credit
from sim_bridge.sweet_home.pack import pack
from sim_bridge.sweet_home.table import Piece, pieces

MOST_TRIANGLES = 31_500
"""Of a model that is shipped; the archive is to stay a few megabytes."""
UNUSED = frozenset({
    "ammoBox", "cissors_swap", "doubleOven", "kalender", "potty", "ruler", "shower", "showerDoor",
    "toiletBrush", "wallLight",
})  # fmt: skip
"""Models that no ``cc0`` room would ever have: their kind is not put up, or what they stand on is
not there."""
PACKAGE = "sweethome3d-furniture 1.8"
COMMAND = "python -m sim_bridge.data.ship_models"
ETEKS = "Emmanuel Puybaret / eTeks"
SCOPIA = f"{ETEKS} and Scopia Visual Interfaces Systems, s.l. (http://www.scopia.es)"


@dataclass(frozen=True)
class ShipOptions:
    """Make the archive of models that comes with cfnav, its NOTICE and the page of credits."""

    out: Path = SHIPPED.parent
    """Folder for the archive and its NOTICE."""
    credits: Path = Path("docs/credits.md")
    """The page that says whom to name for all models."""

    def run_command(self) -> None:
        """Write.

        Raises:
            SweetHomeError: the furniture is not installed.
            OSError: a file cannot be written.
        """
        cast = [piece for role in pieces().values() for piece in role]
        entries = catalogue()
        named = [credit(entries[piece.entry.id]) for piece in cast]
        both = zip(named, cast, strict=True)
        ships = [(who, piece.goals) for who, piece in both if shippable(who, piece)]
        self.out.mkdir(parents=True, exist_ok=True)
        with whole(self.out / SHIPPED.name) as path:
            pack([(who.entry, apart) for who, apart in ships], path)
        size = (self.out / SHIPPED.name).stat().st_size / 1e6
        write_file(self.out / "NOTICE", "\n".join(notice(who for who, _ in ships)) + "\n")
        write_file(self.credits, "\n".join(page(named)) + "\n")
        print(f"{len(ships)} models of {len(named)} in {self.out}, {size:.1f} MB")


def shippable(who: Credit, piece: Piece) -> bool:
    """Whether a model may be shipped: a file of its own says CC0; and is of use, and not large."""
    if not who.own or who.licence != CC0 or piece.entry.id.partition("#")[2] in UNUSED:
        return False
    return sum(len(mesh.faces) for mesh in piece.load().meshes) <= MOST_TRIANGLES


def notice(ships: Iterable[Credit]) -> Iterator[str]:
    """Lines of the NOTICE: each shipped model, its author, licence and source."""
    yield f"{SHIPPED.name} holds 3D models that their authors put in the public domain under"
    yield f"CC0 1.0, {URIS[CC0]}, as a licence file beside"
    yield f"each says in the Debian package {PACKAGE}, from which they are taken."
    yield f"There they come from Blend Swap, cleaned and converted to OBJ by {ETEKS}."
    yield "The licence asks for nothing; thanks to all of them. cfnav keeps only what is seen,"
    yield "positions and textures coarser, in files of its own. Made by"
    yield f"{COMMAND}."
    yield ""
    for who in ships:
        name = who.entry.id.partition("#")[2]
        yield f'{name}: "{who.title}" by {who.entry.creator}, {who.licence}, {who.source}'


def page(named: Iterable[Credit]) -> Iterator[str]:
    """Lines of the page of credits: by licence, then author."""
    groups: dict[str, list[Credit]] = defaultdict(list)
    for who in named:
        catalogue_of = who.entry.archive.stem.partition("-")[0]
        groups[CC0 if who.licence == CC0 else catalogue_of].append(who)
    yield "# Credits for models of furniture"
    yield ""
    yield f"Made by `{COMMAND}` from the licence files of the Debian package {PACKAGE}."
    yield ""
    yield (
        "Pictures and films of `sweet_home.*` rooms show models whose licences ask for credit: "
        "a link to this page beside them gives it. cfnav turns, resizes and renders the models; "
        "it does not ship them. Rooms of `cc0.*` and built-in rooms ask for nothing "
        "([NOTICE](../sim_bridge/sim_bridge/sweet_home/cc0/NOTICE))."
    )
    yield ""
    for catalogue_of, by_whom in (
        ("Scopia", f"by {SCOPIA}, {_link(CC_BY)}."),
        ("KatorLegaz", f"by Andrew Kator & Jennifer Legaz, {_link(CC_BY_US)}."),
        (CC0, f"from Blend Swap in the public domain, {_link(CC0)}."),
        ("BlendSwap", f"from Blend Swap, converted to OBJ by {ETEKS}, each {_link(CC_BY)}:"),
    ):
        yield f"- {len(groups[catalogue_of])} models {by_whom}"
    yield ""
    yield "| author | works |"
    yield "|---|---|"
    authors: dict[str, set[str]] = defaultdict(set)
    for who in groups["BlendSwap"]:
        work = f"[{who.title}]({who.source})" if who.source else who.title
        authors[who.entry.creator].add(work)
    for author in sorted(authors, key=str.casefold):
        yield f"| {author} | {', '.join(sorted(authors[author], key=str.casefold))} |"


def _link(licence: str) -> str:
    return f"[{licence}]({URIS[licence]})"


def main() -> int:
    """The exit code is ``ending``'s."""
    return run_options("ship_models", ShipOptions)


if __name__ == "__main__":
    raise SystemExit(main())
