# Sourced: install Debian packages, or say how.
# shellcheck shell=bash

# install_system_packages WHY PACKAGE...
# Returns non-zero, with the exact command on stderr, if it may not or can not install them.
install_system_packages() {
    local why=$1 run=() log
    shift
    if ! command -v apt-get >/dev/null 2>&1; then
        printf 'punnet: %s: this system has no apt-get; install the equivalent of: %s\n' "$why" "$*" >&2
        return 1
    fi
    if [ "$(id -u)" -ne 0 ]; then
        if ! sudo -n true >/dev/null 2>&1; then
            printf 'punnet: %s; run this, then make again:\n\n    sudo apt-get update && sudo apt-get install -y --no-install-recommends %s\n\n' \
                "$why" "$*" >&2
            return 1
        fi
        run=(sudo -n)
    fi
    printf 'punnet: %s: apt-get install %s\n' "$why" "$*" >&2
    log=$(mktemp)
    # The package lists of a fresh container are empty or old; they are only fetched if the first try fails.
    if "${run[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "$@" >"$log" 2>&1 </dev/null ||
        { "${run[@]}" apt-get update >>"$log" 2>&1 </dev/null &&
            "${run[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "$@" >>"$log" 2>&1 </dev/null; }; then
        rm -f "$log"
        return 0
    fi
    tail -n 15 "$log" >&2
    rm -f "$log"
    printf 'punnet: apt-get could not install: %s (its last lines are above)\n' "$*" >&2
    return 1
}
