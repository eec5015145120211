# shellcheck shell=bash
# Shared by simulate and test: what the machine lacks, and how to build. Sourced, not run.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

say() { printf '== %s\n' "$*"; }

fail() {
  printf 'error: %s\n' "$*" >&2
  exit 1
}

# The column of packages.txt that is for this machine: 2, 3 or 4.
package_column() {
  local id='' version='' like=''
  if [ -r /etc/os-release ]; then
    id=$(. /etc/os-release && echo "${ID:-}")
    version=$(. /etc/os-release && echo "${VERSION_ID:-}")
    like=$(. /etc/os-release && echo "${ID_LIKE:-}")
  fi
  case "$id $version" in
    'debian 12') echo 2 ;;
    'debian 13') echo 4 ;;
    'ubuntu 20.04') echo 3 ;;
    *)
      case " $id $like " in
        *' debian '*)
          say "'$id $version' is not among the tested systems (Debian 12 and 13); trying" \
            "the package names of Debian." >&2
          echo 2
          ;;
        *) fail "needs Debian 12 or 13, or Ubuntu 20.04 with ROS Noetic; this is '$id $version'." ;;
      esac
      ;;
  esac
}

# missing_packages USE...: the packages of these uses that are not installed.
missing_packages() {
  local column wanted installed
  column=$(package_column)
  wanted=$(awk -v uses=" $* " -v column="$column" \
    '!/^#/ && NF && index(uses, " " $1 " ") {
       name = column <= NF ? $column : $2  # Debian 13 differs from 12 in few
       if (name != "-") print name
     }' \
    "$root/scripts/packages.txt" | sort -u)
  # shellcheck disable=SC2016  # the ${} are dpkg-query's
  # dpkg-query fails when it knows nothing of one of them, and still lists the others.
  installed=$(xargs dpkg-query -W -f '${db:Status-Status} ${Package}\n' <<<"$wanted" 2>/dev/null |
    sed -n 's/^installed //p' | sort -u || true)
  comm -23 <(echo "$wanted") <(echo "$installed")
}

# as_root COMMAND...
as_root() {
  if [ "$(id -u)" -eq 0 ]; then
    env DEBIAN_FRONTEND=noninteractive "$@"
  else
    sudo env DEBIAN_FRONTEND=noninteractive "$@"
  fi
}

# Another apt may be at work on a fresh machine: wait for it, five minutes at most.
update_package_lists() {
  local tries output
  for tries in {1..30}; do
    output=$(as_root apt-get -q update 2>&1) && return
    case $output in
      *'Could not get lock'*) [ "$tries" -gt 1 ] || say "Waiting for another apt to end" ;;
      *) break ;;
    esac
    sleep 10
  done
  printf '%s\n' "$output" >&2
  say "apt-get update failed, as shown above; going on with the package lists that are here." >&2
}

# install_missing USE...: does nothing, quickly, where all is there.
install_missing() {
  command -v dpkg-query >/dev/null || fail "needs Debian or Ubuntu: there is no dpkg here."
  local missing
  mapfile -t missing < <(missing_packages "$@")
  [ "${#missing[@]}" -gt 0 ] || return 0

  if [ "$(id -u)" -ne 0 ]; then
    say "Packages are missing; installing them needs sudo, which may ask for your password."
    { command -v sudo >/dev/null && sudo -v; } ||
      fail "you cannot become root by sudo here. Let root run
    apt-get update && apt-get install --no-install-recommends ${missing[*]}
and then run this again."
  fi
  say "Installing by apt, with what they need themselves (some minutes, once):"
  printf '%s\n' "${missing[*]}" | fold -s -w 90 | sed 's/^/     /'
  update_package_lists
  mkdir -p "$root/build"
  as_root apt-get -q -y -o DPkg::Lock::Timeout=600 -o Dpkg::Use-Pty=0 --no-install-recommends \
    install "${missing[@]}" </dev/null 2>&1 | tee "$root/build/apt.log" | show_apt_progress || {
    tail -n 30 "$root/build/apt.log" >&2
    fail "apt could not install these packages; the reason is above, all of it in build/apt.log.
Without a network it cannot; on Ubuntu 20.04 it needs the ROS Noetic repository:
http://wiki.ros.org/noetic/Installation/Ubuntu, steps 1.2 and 1.3."
  }
}

# Of apt's thousands of lines, what tells how far it is.
show_apt_progress() {
  local line packages=0 steps=0
  while read -r line; do
    case $line in
      *' newly installed,'*) packages=${line% newly installed,*} packages=${packages##* } ;;
      'Need to get '* | 'After this operation'* | 'Fetched '*) printf '     %s\n' "$line" ;;
      'Unpacking '* | 'Setting up '*)
        steps=$((steps + 1))
        if ((steps % 100 == 0)); then
          printf '     %s of %s steps done\n' "$steps" $((2 * packages))
        fi
        ;;
    esac
  done
}

# Ubuntu's ROS lives in /opt/ros and has to be asked for; Debian's is in /usr.
use_ros() {
  local setup=/opt/ros/noetic/setup.bash
  # ROS's Python modules belong to the system's Python, and its scripts take the first on PATH.
  export PATH="/usr/bin:$PATH"
  if [ "$(package_column 2>/dev/null)" = 3 ]; then
    [ -r "$setup" ] || fail "$setup is not there, though ROS's packages are."
    source_setup "$setup"
  fi
  # A container's name often resolves to nothing, and then ROS cannot talk to itself.
  if [ -z "${ROS_HOSTNAME:-}${ROS_IP:-}" ] && ! getent hosts "$HOSTNAME" >/dev/null; then
    export ROS_HOSTNAME=localhost
  fi
}

# source_setup FILE: ROS's set-up files use variables that need not be set.
source_setup() {
  set +u
  # shellcheck disable=SC1090
  . "$1"
  set -u
}

# As many compilers as there are processors, but no more than fit: each can take 1.5 GB.
build_jobs() {
  local processors gigabytes_available
  processors=$(nproc)
  gigabytes_available=$(awk '/^MemAvailable/ { print int($2 / 1.5e6) }' /proc/meminfo)
  [ "$gigabytes_available" -ge 1 ] || gigabytes_available=1
  echo $((processors < gigabytes_available ? processors : gigabytes_available))
}

# build DIRECTORY CMAKE_ARGUMENT...: what changed, in build/DIRECTORY of the checkout.
build() {
  local directory="$root/build/$1"
  shift
  # A checkout that was moved or copied takes its old build along, which CMake then refuses.
  if ! grep -qsxF "CMAKE_HOME_DIRECTORY:INTERNAL=$root" "$directory/CMakeCache.txt"; then
    rm -rf "$directory"
  fi
  if ! [ -e "$directory/build.ninja" ]; then
    mkdir -p "$directory"
    cmake -S "$root" -B "$directory" -G Ninja -DCMAKE_BUILD_TYPE=Release \
      -DPYTHON_EXECUTABLE=/usr/bin/python3 "$@" >"$directory/configure.log" 2>&1 || {
      cat "$directory/configure.log" >&2
      fail "CMake could not set up the build; the reason is above."
    }
  fi
  cmake --build "$directory" --parallel "$(build_jobs)" ||
    fail "the build failed; the reason is above."
}
