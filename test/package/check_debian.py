#!/usr/bin/env python3
"""debian/ agrees with the rest of the project: versions, names of libraries, dependencies.

Argument: the project's folder. package.xml and scripts/dependencies.txt say what is needed; what debian/control needs to
build the packages, and what the packages need, must be the same.
"""
import pathlib
import re
import sys
import xml.etree.ElementTree as ElementTree

PACKAGING = {"debhelper-compat", "dh-sequence-python3", "cmake", "help2man", "ninja-build", "python3-all"}


def paragraphs_of(control):
    """The fields of each paragraph of debian/control; lists of packages as sets, without versions."""
    for paragraph in control.split("\n\n"):
        fields = dict(re.findall(r"^([\w-]+):((?:.*\n?)(?: .*\n?)*)", paragraph, re.M))
        yield {name: {re.split(r"[ (]", one.strip())[0] for one in value.split(",")} - {""}
               if name in ("Build-Depends", "Depends", "Recommends") else value.strip() for name, value in fields.items()}


def archive_packages(dependencies):
    """The archive's packages of each key of package.xml."""
    lines = (line.split("#")[0].split() for line in dependencies.splitlines())
    return {words[0]: set(words[1:]) for words in lines if words and words[0] != "-"}


def is_development(package):
    return package.endswith("-dev")


def differences(what, expected, found):
    return [f"{what}: {', '.join(sorted(expected - found))} is missing"] * bool(expected - found) + \
        [f"{what}: {', '.join(sorted(found - expected))} is not needed"] * bool(found - expected)


def check(project):
    root = ElementTree.parse(project / "package.xml").getroot()
    version = root.findtext("version")
    source, *binaries = paragraphs_of((project / "debian/control").read_text())
    packages = archive_packages((project / "scripts/dependencies.txt").read_text())
    by_name = {binary["Package"]: binary for binary in binaries}

    def keys(*kinds):
        return {element.text for element in root if element.tag in kinds}

    def of(wanted):
        return set().union(*(packages[key] for key in wanted))

    problems = []
    changelog = re.match(r"us-ct-registration \((.*?)\)", (project / "debian/changelog").read_text()).group(1)
    cmake = (project / "CMakeLists.txt").read_text()
    if {changelog, re.search(r"project\(\S+ VERSION (\S+)", cmake).group(1)} != {version}:
        problems.append(f"debian/changelog has version {changelog}, package.xml {version}; CMakeLists.txt must agree")
    interface = ".".join(version.split(".")[:2])
    for library in ("core", "ros"):
        if f"libus-ct-registration-{library}{interface}" not in by_name:
            problems.append(f"no package libus-ct-registration-{library}{interface}, as the library's SONAME has it")

    # Python modules are no part of a build; catkin brings its own.
    built = {package for package in of(keys("buildtool_depend", "depend", "build_depend"))
             if not package.startswith("python3-") and not package.endswith("-tools")}
    problems += differences("Build-Depends", built, source["Build-Depends"] - PACKAGING)

    # The packages that find_package(us_ct_registration) looks for.
    components = set(re.search(r"USCT_MESSAGE_PACKAGES ([^)]*)", cmake).group(1).split()) | \
        set(re.search(r"USCT_ROS_PACKAGES ([^)]*)", cmake).group(1).split())
    headers = {package for package in of(components | {"eigen"}) if is_development(package)}
    depends = by_name["libus-ct-registration-dev"]["Depends"]
    problems += differences("libus-ct-registration-dev", headers, {name for name in depends if is_development(name)})

    # Libraries come by themselves (shlibs), and Python modules of messages with the package that imports them.
    run_time = {package for package in of(keys("depend", "exec_depend"))
                if not is_development(package) and not (package.startswith("ros-") and package.endswith("-msgs"))}
    brought = set().union(*(binary.get(field, set()) for binary in binaries for field in ("Depends", "Recommends")))
    problems += [f"no package depends on {name}" for name in sorted(run_time - brought)]
    return problems


def main():
    problems = check(pathlib.Path(sys.argv[1]))
    if problems:
        sys.exit("debian/control, package.xml and scripts/dependencies.txt disagree:\n" + "\n".join(problems))
    print("debian/ agrees with package.xml and scripts/dependencies.txt")


if __name__ == "__main__":
    main()
