#!/usr/bin/env python3
"""Everything that programs with the published crates contain has a licence out of a list.

Dependencies for tests are left out. Crates that offer a choice need one licence of the list; of licences
that hold together, all have to be in it.
"""

import json
import re
import subprocess
import sys

PUBLISHED = ["casados", "casados-core", "casados-macros"]
ACCEPTED = {"MIT", "Apache-2.0", "Apache-2.0 WITH LLVM-exception", "BSD-3-Clause", "ISC", "Unicode-3.0", "Unlicense", "Zlib"}


def accepted(expression):
    """Whether an SPDX expression can be satisfied: `OR` (or the old `/`) below `AND`, with brackets."""
    tokens = re.findall(r"\(|\)|[^\s()/]+|/", expression.replace("/", " OR "))
    position = 0

    def alternatives():
        nonlocal position
        holds = together()
        while position < len(tokens) and tokens[position] == "OR":
            position += 1
            holds = together() or holds
        return holds

    def together():
        nonlocal position
        holds = one()
        while position < len(tokens) and tokens[position] == "AND":
            position += 1
            holds = one() and holds
        return holds

    def one():
        nonlocal position
        if position >= len(tokens):
            return False
        token = tokens[position]
        position += 1
        if token == "(":
            holds = alternatives()
            position += 1
            return holds
        if tokens[position : position + 1] == ["WITH"]:
            token = f"{token} WITH {tokens[position + 1]}"
            position += 2
        return token in ACCEPTED

    return alternatives() and position == len(tokens)


def self_test():
    for expression in ["MIT", "GPL-3.0 OR MIT", "MIT/GPL-3.0", "(MIT OR GPL-3.0) AND Unicode-3.0", "Apache-2.0 WITH LLVM-exception"]:
        assert accepted(expression), expression
    for expression in ["", "GPL-3.0", "MIT AND GPL-3.0", "(MIT OR Zlib) AND MPL-2.0", "Apache-2.0 WITH GPL-exception"]:
        assert not accepted(expression), expression


def main():
    self_test()
    command = ["cargo", "metadata", "--locked", "--format-version", "1", "--all-features"]
    metadata = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    packages = {package["id"]: package for package in metadata["packages"]}
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    reached, open_ids = set(), [id for id in packages if packages[id]["name"] in PUBLISHED]
    while open_ids:
        id = open_ids.pop()
        if id in reached:
            continue
        reached.add(id)
        for dependency in nodes[id]["deps"]:
            if any(kind["kind"] != "dev" for kind in dependency["dep_kinds"]):
                open_ids.append(dependency["pkg"])
    bad = sorted(
        f"{packages[id]['name']} {packages[id]['version']}: {packages[id]['license']}"
        for id in reached
        if not accepted(packages[id]["license"] or "")
    )
    if bad:
        sys.exit("not in the list of licences:\n" + "\n".join(bad))
    print(f"{len(reached)} packages, all with a licence of the list")
    only = sorted(packages[id]["name"] for id in reached if packages[id]["license"] == "Apache-2.0")
    print("Apache-2.0 alone:", ", ".join(only))


main()
