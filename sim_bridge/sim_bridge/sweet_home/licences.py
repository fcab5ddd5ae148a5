"""Under which licence a model is, and whom to name: what its own folder says before its archive.

The catalogues say one licence for a whole archive, and are wrong about a few models in it.
"""

from __future__ import annotations

import html
import posixpath
import re
import zipfile
from dataclasses import dataclass

from sim_bridge.sweet_home.catalogue import Entry, SweetHomeError

CC0, CC_BY, CC_BY_US = "CC0-1.0", "CC-BY-3.0", "CC-BY-3.0-US"
"""Identifiers of SPDX."""
URIS = {
    CC0: "https://creativecommons.org/publicdomain/zero/1.0/",
    CC_BY: "https://creativecommons.org/licenses/by/3.0/",
    CC_BY_US: "https://creativecommons.org/licenses/by/3.0/us/",
}
NAMES = {"Zero": CC0, "Attribution 3.0": CC_BY, "Attribution 3.0 United States": CC_BY_US}
"""After "Creative Commons"."""
LICENCE = re.compile(r"Creative Commons (Zero|Attribution 3\.0(?: United States)?)")
TITLE = re.compile(
    r'downloading "(.+?)" by |<title>\s*(?:\d+ - )?(.+?)(?: by [^<]+?)?(?: - \d+)? - [DC]'
)
SOURCE = re.compile(r"https?://www\.blendswap\.com/blends/view/\d+")


@dataclass(frozen=True)
class Credit:
    """Whom to name for a model.

    Attributes:
        entry: the model.
        licence: one of ``URIS``.
        title: of the work, by its author.
        source: where the author published it; "" where nothing says so.
        own: whether a file beside the model says so, not its archive alone.
    """

    entry: Entry
    licence: str
    title: str
    source: str
    own: bool


def credit(entry: Entry) -> Credit:
    """Read whom to name for a model.

    Raises:
        SweetHomeError: neither its folder nor its archive names a licence that is known here.
    """
    folder = posixpath.dirname(entry.model)
    with zipfile.ZipFile(entry.archive) as archive:
        beside = [
            name for name in archive.namelist()
            if posixpath.dirname(name) == folder and "license" in name.lower()
        ]  # fmt: skip
        own = "".join(archive.read(name).decode("utf-8", "replace") for name in beside)
        texts = own, archive.read("LICENSE.TXT").decode("latin-1")
    said = next(filter(None, map(_licences, texts)), None)
    if said is None:
        raise SweetHomeError(f"found no licence of {entry.id} in {entry.archive}; leave it out")
    title, source = TITLE.search(own), SOURCE.search(own)
    return Credit(
        entry, max(said, key=[*URIS].index),
        html.unescape(next(filter(None, title.groups()))).strip() if title else entry.name,
        source[0].replace("http:", "https:") if source else "", own=bool(_licences(own)),
    )  # fmt: skip


def _licences(text: str) -> set[str]:
    plain = " ".join(re.sub(r"<[^>]+>", " ", text).split())
    return {NAMES[name] for name in LICENCE.findall(plain)}
