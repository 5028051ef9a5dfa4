"""Makes the figures' font: a renamed subset of Source Sans 3. Usage: subset.py FOLDER_WITH_TTF OUT_FOLDER"""
import pathlib
import sys

from fontTools import subset
from fontTools.ttLib import TTFont

FAMILY = "Mirrorstats Sans"
UNICODES = [
    (0x0020, 0x007E), (0x00A0, 0x017F), (0x0218, 0x021B), (0x037E, 0x03CE), (0x0400, 0x045F), (0x1E9E, 0x1E9E),
    (0x2010, 0x2026), (0x2030, 0x2033), (0x2070, 0x208E), (0x20AC, 0x20AC), (0x2122, 0x2122), (0x2190, 0x2193),
    (0x2212, 0x2212), (0x2248, 0x2248), (0x2260, 0x2265), (0x25A1, 0x25A1),
]


def make(source: pathlib.Path, style: str, out: pathlib.Path) -> None:
    options = subset.Options(
        layout_features=["kern"], hinting=False, notdef_outline=True, name_IDs=[0, 1, 2, 3, 4, 5, 6, 13, 14],
        name_languages=[0x409], legacy_kern=False, drop_tables=subset.Options().drop_tables + ["DSIG", "STAT", "meta"], recalc_timestamp=False,
    )
    font = TTFont(source, recalcTimestamp=False)
    chosen = subset.Subsetter(options)
    chosen.populate(unicodes=[u for a, b in UNICODES for u in range(a, b + 1)])
    chosen.subset(font)
    names = font["name"]
    names.names = [n for n in names.names if n.nameID in (0, 13, 14) and n.platformID == 3]
    subfamily = "Regular" if style == "Regular" else "Bold"
    for name_id, text in [(1, FAMILY), (2, subfamily), (3, f"3.052;{FAMILY} {style}"), (4, f"{FAMILY} {style}"),
                          (5, "Version 3.052; subset"), (6, f"{FAMILY.replace(' ', '')}-{style}")]:
        names.setName(text, name_id, 3, 1, 0x409)
    font["OS/2"].usWeightClass = 400 if style == "Regular" else 600
    stem = FAMILY.replace(" ", "") + "-" + style
    font.save(out / f"{stem}.ttf")
    font.flavor = "woff2"
    font.save(out / f"{stem}.woff2")


if __name__ == "__main__":
    source, out = map(pathlib.Path, sys.argv[1:])
    for style in ("Regular", "Semibold"):
        make(source / f"SourceSans3-{style}.ttf", style, out)
