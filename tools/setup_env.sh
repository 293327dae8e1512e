#!/bin/sh
# Make or bring up to date the environment .venv-VERSION and print the path of its interpreter.
# usage: setup_env.sh 3.11|3.13 EXTRA[,EXTRA...] [PYTHON]
# The stamp in the environment holds what it was made from (the folder, and a checksum of what pyproject.toml and the
# manifest say about the package) and which extras it has: nothing is done, in no time, if that is what is asked for.
# Everything but the path goes to standard error.
set -eu

version=${1:?usage: setup_env.sh 3.11|3.13 EXTRAS [PYTHON]}
extras=${2:?usage: setup_env.sh 3.11|3.13 EXTRAS [PYTHON]}
cd "$(dirname "$0")/.."

env_dir=$PWD/.venv-$version
python=$env_dir/bin/python
stamp=$env_dir/synthroads-stamp
sources="$PWD $(sed '/^\[tool\.pytest/,$d' pyproject.toml | cat - blender_manifest.toml | cksum)"

have=""
if [ -f "$stamp" ] && "$python" -c "" 2>/dev/null; then
    if [ "$(sed -n 1p "$stamp")" = "$sources" ]; then have=$(sed -n 2p "$stamp"); fi
    before=$(sed -n 2p "$stamp")
else
    before=""
fi

missing=""
for extra in $(echo "$extras" | tr ',' ' '); do
    case ",$have," in *",$extra,"*) ;; *) missing=yes ;; esac
done
if [ -z "$missing" ]; then
    echo "$python"
    exit 0
fi

base=$(sh tools/find_python.sh "$version" "${3:-}") || {
    echo "No usable Python $version." >&2
    exit 1
}
if ! "$python" -c "import pip" 2>/dev/null; then
    echo "Making .venv-$version with $base" >&2
    "$base" -m venv --clear "$env_dir" >&2
fi
rm -f "$stamp"

# What was there stays there: the union of the old and the new extras.
wanted=$(echo "$before,$extras" | tr ',' '\n' | sed '/^$/d' | sort -u | paste -sd, -)
echo "Installing synthroads[$wanted] into .venv-$version (the first time downloads some 400 MB)" >&2
PIP_DISABLE_PIP_VERSION_CHECK=1 "$python" -m pip install --quiet --no-input --editable ".[$wanted]" >&2

case ",$wanted," in
    *,blender,*) "$python" tools/check_bpy.py >&2 ;;
esac
printf '%s\n%s\n' "$sources" "$wanted" >"$stamp"
echo "$python"
