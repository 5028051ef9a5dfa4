#!/usr/bin/env python3
"""sbom.py FILE: the packages of the wheel as CycloneDX JSON; the same bytes for the same Cargo.lock."""

import hashlib
import json
import subprocess
import sys
import tomllib
import uuid
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PLATFORM = "x86_64-unknown-linux-gnu"


def metadata():
    command = ["cargo", "metadata", "--format-version", "1", "--locked", "--all-features", "--filter-platform", PLATFORM]
    return json.loads(subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE).stdout)


def lockfile():
    packages = tomllib.loads((ROOT / "Cargo.lock").read_text())["package"]
    return {(package["name"], package["version"]): package.get("checksum") for package in packages}


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


if __name__ == "__main__":
    sbom(sys.argv[1])
