#!/usr/bin/env bash
# Find an OpenGL back end that MuJoCo can render with and no display, install Mesa's software one if there is none,
# and write its name into the environment. Needs scripts/activate.sh sourced.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source scripts/system_packages.sh

stamp=$PUNNET_VENV/punnet-rendering
mujoco=$(python -c 'import importlib.metadata as m; print(m.version("mujoco"))')

renders() { # whether back end $1 gives a context
    MUJOCO_GL=$1 PYTHONWARNINGS=ignore python -c '
import mujoco
context = mujoco.GLContext(64, 64)
context.make_current()
mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), 150)
' >/dev/null 2>&1
}

found() {
    printf '%s %s\n' "$1" "$mujoco" >"$stamp"
    exit 0
}

if [ "$(uname)" = Darwin ]; then exit 0; fi
if [ "$(cut -d' ' -f2 "$stamp" 2>/dev/null || true)" = "$mujoco" ]; then exit 0; fi
rm -f "$stamp"
for backend in ${MUJOCO_GL:-} egl osmesa; do
    if renders "$backend"; then found "$backend"; fi
done
if install_system_packages "rendering without a display needs a GL library" libegl1 libgl1 libgl1-mesa-dri; then
    if renders egl; then found egl; fi
    if install_system_packages "EGL does not start here; trying OSMesa" libosmesa6; then
        if renders osmesa; then found osmesa; fi
    fi
    echo "punnet: neither EGL nor OSMesa renders here; what EGL says:" >&2
    MUJOCO_GL=egl python -c 'import mujoco; mujoco.GLContext(64, 64).make_current()' 2>&1 | tail -n 5 >&2 || true
fi
exit 1
