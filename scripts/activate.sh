# Sourced: put the project's environment and its rendering back end (found by rendering.sh) in place.
# shellcheck shell=bash
PATH="$PUNNET_VENV/bin:$PATH"
export PATH VIRTUAL_ENV="$PUNNET_VENV"
if [ -z "${MUJOCO_GL:-}" ] && [ -r "$PUNNET_VENV/punnet-rendering" ]; then
    MUJOCO_GL=$(cut -d' ' -f1 "$PUNNET_VENV/punnet-rendering")
    export MUJOCO_GL
fi
