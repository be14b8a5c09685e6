#!/usr/bin/env bash
# Make the environment of a program that reads our files in tests and cannot live in .venv.
# Usage: client_env.sh nuscenes|torch|rerun|openlabel [FOLDER]. FOLDER is .clients/NAME by default. Needs Python 3.9 to 3.12 and pip.
# PYTHON names another interpreter. A finished environment is kept; it is made again when the packages below change.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

case "${1:-}" in
    nuscenes) packages=("nuscenes-devkit==1.2.0" "numpy==1.26.4" "opencv-python-headless<4.11") ;;
    torch) packages=("torch==2.13.0" "numpy" "zarr>=3.1,<4" "pydantic>=2.6,<3" "scipy" "pillow" "pyyaml" "trimesh" "matplotlib" "filelock" "lazy_loader" "finufft>=2.3,<3") ;;
    rerun) packages=("rerun-sdk==0.41.0" "numpy" "zarr>=3.1,<4" "pydantic>=2.6,<3" "scipy" "pillow" "pyyaml" "trimesh" "matplotlib" "filelock" "lazy_loader" "rich" "typer" "finufft>=2.3,<3") ;;
    openlabel) packages=("vcd==6.0.3") ;;
    *) echo "usage: client_env.sh nuscenes|torch|rerun|openlabel [FOLDER]" >&2; exit 2 ;;
esac
folder="${2:-.clients/$1}"
stamp="$folder/.packages"

if [ "$(cat "$stamp" 2>/dev/null)" = "${packages[*]}" ]; then exit 0; fi
python="${PYTHON:-}"
for name in python3.11 python3.12 python3.10 python3; do
    if [ -z "$python" ] && command -v "$name" >/dev/null 2>&1; then python="$name"; fi
done
echo "making $folder with $("$python" --version)"
"$python" -m venv --clear "$folder"
"$folder/bin/python" -m pip install --quiet --disable-pip-version-check "${packages[@]}"
printf '%s\n' "${packages[*]}" > "$stamp"
