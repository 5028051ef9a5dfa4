#!/usr/bin/env python3
"""What is compiled in, and under which terms.

supply-chain.py check          licences, sources and duplicates of all packages, by the lists of deny.toml; known faults
                               of their versions, by advisories.toml
supply-chain.py sbom FILE      the packages of the wheel as CycloneDX JSON; the same bytes for the same Cargo.lock
supply-chain.py unsafe         docs/reference/unsafe.md: `unsafe` in packages that touch the bytes of others

`check` needs no network. Where cargo-deny is installed it runs as well, with its newer database of advisories.
"""

import hashlib
import json
import re
import shutil
import subprocess
import sys
import tomllib
import uuid
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PLATFORM = "x86_64-unknown-linux-gnu"

# What decodes, decompresses or parses what others wrote, from the program's own reader to the server's.
FOREIGN_BYTES = [
    "arrow-array", "arrow-buffer", "arrow-data", "arrow-select", "brotli-decompressor", "bytes", "crc32fast", "csv-core",
    "flate2", "httparse", "hyper", "lz4_flex", "mcap", "memchr", "parquet", "png", "prost", "regex-automata", "serde_json",
    "simdutf8", "snap", "sqlparser", "toml_parser", "ttf-parser", "zip", "zlib-rs", "zstd", "zstd-safe", "zstd-sys",
]


def fail(words):
    sys.exit(f"supply-chain: {words}")


def metadata():
    command = ["cargo", "metadata", "--format-version", "1", "--locked", "--all-features", "--filter-platform", PLATFORM]
    return json.loads(subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE).stdout)


def lockfile():
    packages = tomllib.loads((ROOT / "Cargo.lock").read_text())["package"]
    return {(package["name"], package["version"]): package.get("checksum") for package in packages}


def is_allowed(expression, allowed):
    """Returns true if an SPDX expression can be fulfilled with allowed licences."""
    words = re.findall(r"\(|\)|[^\s()]+", expression.replace("/", " OR "))
    merged = []
    for word in words:
        if merged and (word == "WITH" or merged[-1].endswith(" WITH")):
            merged[-1] += f" {word}"
        else:
            merged.append(word)

    def either():
        value = both()
        while merged and merged[0] == "OR":
            merged.pop(0)
            value = both() or value
        return value

    def both():
        value = one()
        while merged and merged[0] == "AND":
            merged.pop(0)
            value = one() and value
        return value

    def one():
        word = merged.pop(0)
        if word != "(":
            return word in allowed
        value = either()
        merged.pop(0)
        return value

    return either()


def check():
    rules = tomllib.loads((ROOT / "deny.toml").read_text())
    allowed = set(rules["licenses"]["allow"])
    packages = metadata()["packages"]
    foreign = [package for package in packages if package["source"]]
    faults = []
    for package in foreign:
        name = f"{package['name']} {package['version']}"
        if not package["license"] or not is_allowed(package["license"], allowed):
            faults.append(f"{name}: the licence {package['license']} is not in deny.toml")
        if not package["source"].startswith("registry+https://github.com/rust-lang/crates.io-index"):
            faults.append(f"{name}: expected a package of crates.io, found {package['source']}")
    versions = defaultdict(set)
    for package in packages:
        versions[package["name"]].add(package["version"])
    skipped = {entry["crate"] for entry in rules["bans"]["skip"]}
    twice = {name: found for name, found in versions.items() if len(found) > 1}
    for name, found in sorted(twice.items()):
        unknown = sorted(f"{name}@{version}" for version in found if f"{name}@{version}" not in skipped)
        if len(unknown) > 1:
            faults.append(f"{name} is there as {', '.join(unknown)}: give the reason in deny.toml, or update")
    known = {f"{package['name']}@{package['version']}" for package in packages}
    faults += [f"deny.toml skips {name}, which is not there" for name in sorted(skipped - known)]
    found, uncovered = advised(foreign)
    faults += found
    if faults:
        fail("\n  ".join(faults))
    print(f"supply-chain: {len(foreign)} packages, licences allowed, {len(twice)} in several versions with reasons")
    if shutil.which("cargo-deny"):
        subprocess.run(["cargo", "deny", "--all-features", "check"], cwd=ROOT, check=True)
    else:
        print("supply-chain: advisories by advisories.toml alone, as cargo-deny is not installed")
    if uncovered:
        print(f"supply-chain: not in advisories.toml: {', '.join(uncovered)}")


def numbers(version):
    return tuple(int(number) for number in re.findall(r"\d+", re.split(r"[-+]", version)[0]))


def meets(version, requirement):
    """Returns true if a version meets each part of a requirement such as `>= 1.2.3, < 1.3` or `^0.4.2`."""
    found = numbers(version)
    for part in requirement.split(","):
        sign, wanted = re.fullmatch(r"\s*(>=|<=|>|<|=|\^|~)?\s*([\w.+-]+)\s*", part).groups()
        wanted = (numbers(wanted) + (0, 0))[:3]
        if sign in (None, "^", "~"):
            # What may change: the numbers behind the first that is not 0, or behind the second.
            kept = 2 if sign == "~" else next((at + 1 for at, number in enumerate(wanted) if number), 3)
            is_met = found >= wanted and found[:kept] == wanted[:kept]
        else:
            is_met = {">=": found >= wanted, "<=": found <= wanted, ">": found > wanted, "<": found < wanted,
                      "=": found == wanted}[sign]
        if not is_met:
            return False
    return True


def advised(foreign):
    """Versions with a known fault that advisories.toml does not accept, and packages that it does not cover."""
    snapshot = tomllib.loads((ROOT / "advisories.toml").read_text())
    faults = []
    for entry in snapshot["advisory"]:
        for package in foreign:
            is_safe = any(meets(package["version"], good) for good in entry["patched"] + entry.get("unaffected", []))
            if package["name"] == entry["package"] and not is_safe and "accepted" not in entry:
                name = f"{package['name']} {package['version']}"
                faults.append(f"{name}: {entry['id']}, {entry['title']}: update it, or accept this in advisories.toml")
    return faults, sorted({package["name"] for package in foreign} - set(snapshot["packages"].split()))


def compiled_in(data):
    """The packages that the wheel is compiled from."""
    nodes = {node["id"]: node for node in data["resolve"]["nodes"]}
    packages = {package["id"]: package for package in data["packages"]}
    root = next(package["id"] for package in data["packages"] if package["name"] == "mirrorstats-python")
    found, open_ = {}, [root]
    while open_:
        node = nodes[open_.pop()]
        if node["id"] in found:
            continue
        kinds = lambda dependency: any(kind["kind"] is None for kind in dependency["dep_kinds"])
        needs = sorted(dependency["pkg"] for dependency in node["deps"] if kinds(dependency))
        found[node["id"]] = needs
        open_ += needs
    return root, {identity: (packages[identity], needs) for identity, needs in found.items()}


def reference(package):
    return f"pkg:cargo/{package['name']}@{package['version']}"


def component(package, checksums):
    licence = (package["license"] or "").replace("/", " OR ")
    entry = {
        "type": "library",
        "bom-ref": reference(package),
        "name": package["name"],
        "version": package["version"],
        "purl": reference(package),
        "licenses": [{"expression": licence}],
    }
    checksum = checksums.get((package["name"], package["version"]))
    if checksum:
        entry["hashes"] = [{"alg": "SHA-256", "content": checksum}]
    return entry


def sbom(target):
    data, checksums = metadata(), lockfile()
    root, found = compiled_in(data)
    package_of = {identity: package for identity, (package, _) in found.items()}
    components = [component(package, checksums) for identity, package in package_of.items() if identity != root]
    dependencies = [
        {"ref": reference(package), "dependsOn": sorted(reference(package_of[need]) for need in needs)}
        for package, needs in found.values()
    ]
    whole = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {"component": {**component(package_of[root], checksums), "type": "application", "name": "mirrorstats"}},
        "components": sorted(components, key=lambda entry: entry["bom-ref"]),
        "dependencies": sorted(dependencies, key=lambda entry: entry["ref"]),
    }
    digest = hashlib.sha256(json.dumps(whole, sort_keys=True).encode()).hexdigest()
    whole["serialNumber"] = f"urn:uuid:{uuid.uuid5(uuid.NAMESPACE_OID, digest)}"
    Path(target).write_text(json.dumps(whole, indent=1, sort_keys=True) + "\n")
    print(f"{target}: {len(components)} packages")


def code_of(path):
    """A source without comments and texts."""
    text = path.read_text(errors="replace")
    return re.sub(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\])*"', "", text, flags=re.S)


def counted(package):
    folder = Path(package["manifest_path"]).parent
    blocks = others = lines = 0
    for path in sorted(folder.glob("src/**/*.rs")):
        code = code_of(path)
        lines += sum(1 for line in code.splitlines() if line.strip())
        blocks += len(re.findall(r"\bunsafe\s*\{", code))
        others += len(re.findall(r"\bunsafe\s+(?:extern|fn|impl|trait)\b", code))
    return lines, blocks, others


def unsafe():
    found = {}
    for package in metadata()["packages"]:
        if package["name"] in FOREIGN_BYTES:
            found[(package["name"], package["version"])] = counted(package)
    missing = set(FOREIGN_BYTES) - {name for name, _ in found}
    if missing:
        fail(f"no package {', '.join(sorted(missing))}: correct FOREIGN_BYTES")
    rows = [f"| {name} {version} | {a:,} | {b:,} | {c:,} |" for (name, version), (a, b, c) in sorted(found.items())]
    total = [sum(column) for column in zip(*found.values())]
    text = [
        "# `unsafe` in dependencies",
        "",
        "Our own crates forbid `unsafe` (`unsafe_code = \"forbid\"` in `Cargo.toml`); the Python module has one block, for",
        "Arrow's C interface.",
        "These packages decode, decompress or parse what others wrote. `scripts/supply-chain.py unsafe` counts them.",
        "",
        "| package | lines | `unsafe` blocks | `unsafe` functions, implementations, traits |",
        "|---|---|---|---|",
        *rows,
        f"| all | {total[0]:,} | {total[1]:,} | {total[2]:,} |",
        "",
        "zstd-sys and brotli's dictionaries bring C or tables that are not counted. Pages, footers and logs are checked before",
        "these packages see them, and every fuzz target runs them with overflow checks.",
    ]
    (ROOT / "docs/reference/unsafe.md").write_text("\n".join(text) + "\n")


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["check"]:
            check()
        case ["sbom", target]:
            sbom(target)
        case ["unsafe"]:
            unsafe()
        case _:
            sys.exit(__doc__)
