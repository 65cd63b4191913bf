#!/usr/bin/env bash
# Copyright 2026 The rt_robot_os authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

# Sourced by scripts/run and scripts/test: finds or makes the Python environment, builds the package
# with colcon, and enters the result. Each step does nothing when it has been done before.
#
# Environment variables a user may set:
#   RT_ROBOT_OS_PYTHON  the Python to use (3.10 to 3.13)
#   RT_ROBOT_OS_VENV    where the virtual environment is, or is to be made
#   RT_ROBOT_OS_COMPILE 0 forbids the compiled build, 1 demands it; else it is made where it can be

ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)
PACKAGE=rt_robot_os
LOG=$ROOT/log/setup.log
PROGRAM=   # that is to be started: its extras are added
EXTRAS=()  # of the package that are to be installed
INSTALL_AGAIN= # whether pip is asked although a stamp says that they are there
MODE=      # wheels: ROS 2 Jazzy from wheels in a virtual environment; ros: the sourced installation
BASE=      # the Python that a virtual environment is made from
VENV=
PYTHON=    # the Python that runs the package

say() { printf '%s: %s\n' "$PACKAGE" "$*" >&2; }

fail() {
  say "error: $*"
  exit 2
}

logged() { printf '+ %s\n' "$*" >>"$LOG"; "$@" >>"$LOG" 2>&1 </dev/null; }

# ---- which ROS 2, which Python ---------------------------------------------------------------

version_of() { "$1" -I -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null; }

suitable() { case $(version_of "$1") in 3.10 | 3.11 | 3.12 | 3.13) ;; *) return 1 ;; esac; }

can_make_venv() { "$1" -I -c 'import ensurepip, venv' >/dev/null 2>&1; }

# The Pythons worth a try, best first, each file once. One named by the user is the only one.
candidates() {
  local name path seen=:
  if [ -n "${RT_ROBOT_OS_PYTHON:-}" ]; then
    printf '%s\n' "$RT_ROBOT_OS_PYTHON"
    return
  fi
  for name in python3 python3.12 python3.11 python3.10 python3.13; do
    while read -r path; do
      case $seen in *":$(readlink -f "$path"):"*) continue ;; esac
      seen=$seen$(readlink -f "$path"):
      printf '%s\n' "$path"
    done < <(type -aP "$name")
  done
}

choose_mode() {
  if [ -n "${ROS_DISTRO:-}" ] && [ "$ROS_DISTRO" != jazzy ]; then
    fail "ROS 2 '$ROS_DISTRO' is sourced, this package needs 'jazzy': source /opt/ros/jazzy/setup.bash" \
      "in a new shell, or use a shell without ROS"
  fi
  if [ -n "${ROS_DISTRO:-}" ] && [ -n "${AMENT_PREFIX_PATH:-}" ]; then
    MODE=ros
  else
    MODE=wheels
    # What an earlier shell left behind must not choose the libraries of this environment.
    unset AMENT_PREFIX_PATH COLCON_PREFIX_PATH PYTHONHOME _ROS_WHEELS_BOOTSTRAP_COMPLETE
    forget_wheel_libraries
  fi
}

forget_wheel_libraries() {
  local kept='' part parts
  IFS=: read -r -a parts <<<"${LD_LIBRARY_PATH:-}"
  for part in "${parts[@]}"; do
    case $part in *'/site-packages/ros_'*) ;; ?*) kept=${kept:+$kept:}$part ;; esac
  done
  if [ -n "$kept" ]; then export LD_LIBRARY_PATH=$kept; else unset LD_LIBRARY_PATH; fi
}

choose_python() {
  local python version found='' without_venv=''
  while read -r python; do
    version=$(version_of "$python") || continue
    found=${found:+$found, }"$python $version"
    suitable "$python" || continue
    if [ "$MODE" = ros ] && ! "$python" -c 'import rclpy' >/dev/null 2>&1; then continue; fi
    if can_make_venv "$python"; then
      BASE=$python
      return
    fi
    without_venv=${without_venv:-$python}
  done < <(candidates)
  if [ -n "$without_venv" ]; then
    if [ "$MODE" = ros ] && [ "$KIND" = run ] && has_what_runs "$without_venv"; then
      BASE=$without_venv
      return
    fi
    fail "$without_venv cannot make virtual environments:" \
      "sudo apt install python$(version_of "$without_venv")-venv"
  fi
  if [ "$MODE" = ros ]; then
    fail "ROS 2 jazzy is sourced, but no Python here can import rclpy (tried ${found:-none}):" \
      "leave other virtual environments, or sudo apt install ros-jazzy-rclpy"
  fi
  if [ -n "${RT_ROBOT_OS_PYTHON:-}" ]; then
    fail "RT_ROBOT_OS_PYTHON=$RT_ROBOT_OS_PYTHON ${version:+is Python }${version:-does not start}:" \
      "set it to a Python 3.10 to 3.13, or unset it"
  fi
  fail "Python 3.10 to 3.13 is needed, found ${found:-none}:" \
    "sudo apt install python3 python3-venv, or set RT_ROBOT_OS_PYTHON to one"
}

# ---- the virtual environment -----------------------------------------------------------------

# The table of libraries, which any Python reads.
table() { "$1" -I "$ROOT/$PACKAGE/base/requirements.py" "${@:2}"; }

# The base alone: optional libraries are asked for by what needs them.
has_what_runs() { can_build "$1" && [ -z "$(table "$1" missing base)" ]; }

can_build() { "$1" -c 'import colcon_core, colcon_ros' >/dev/null 2>&1; }

has_everything() {
  local missing
  missing=$(table "$1" missing "${EXTRAS[@]}") || exit 2
  can_build "$1" && [ -z "$missing" ] || return
  [ "$KIND" = run ] || "$1" -c 'import mypy' >/dev/null 2>&1
}

# With ROS sourced and nothing missing, no virtual environment is needed at all.
choose_environment() {
  local default=.venv
  [ "$MODE" = wheels ] || default=.venv-ros
  VENV=${RT_ROBOT_OS_VENV:-$ROOT/$default}
  case $VENV in /*) ;; *) VENV=$PWD/$VENV ;; esac
  PYTHON=$VENV/bin/python
  if [ "$MODE" = ros ] && ! venv_is_ready; then
    choose_python
    add_extras_of_program "$BASE"
    if has_everything "$BASE"; then
      PYTHON=$BASE
      VENV=
    fi
  fi
}

# Ours when the mark is there: only then may it be thrown away.
venv_mark() { cat "$VENV/.$PACKAGE" 2>/dev/null; }

venv_is_ready() {
  local version
  [ "$(venv_mark)" = "$MODE" ] || return 1
  version=$(version_of "$PYTHON") || return 1
  [ -z "${RT_ROBOT_OS_PYTHON:-}" ] || [ "$(version_of "$RT_ROBOT_OS_PYTHON")" = "$version" ]
}

make_venv() {
  local options=()
  venv_is_ready && return
  if [ -e "$VENV" ] && [ -z "$(venv_mark)" ] && [ -n "$(ls -A "$VENV" 2>/dev/null)" ]; then
    adopt_venv
    return
  fi
  spare_the_other_kind
  [ -n "$BASE" ] || choose_python
  say "making the virtual environment $VENV (Python $(version_of "$BASE"))"
  [ "$MODE" = wheels ] || options=(--system-site-packages)
  rm -rf "$VENV"
  mkdir -p "$VENV" || fail "cannot write to $VENV: set RT_ROBOT_OS_VENV to a folder that can be written"
  echo incomplete >"$VENV/.$PACKAGE"
  logged "$BASE" -m venv "${options[@]}" "$VENV" || fail "$BASE -m venv failed, see $LOG"
  echo "$MODE" >"$VENV/.$PACKAGE"
}

# One that the user named is not made anew for another kind of shell: what runs from it would end.
spare_the_other_kind() {
  [ -n "${RT_ROBOT_OS_VENV:-}" ] || return 0
  case $(venv_mark):$MODE in
    wheels:ros) fail "$VENV was made without ROS, and here ROS 2 is sourced:" \
      "set RT_ROBOT_OS_VENV to another folder, or use a shell without ROS" ;;
    ros:wheels) fail "$VENV was made for ROS 2 that is sourced, and here it is not:" \
      "source it, or set RT_ROBOT_OS_VENV to another folder" ;;
  esac
}

# A folder that was there before: used when it is a virtual environment that works, never removed.
adopt_venv() {
  [ -f "$VENV/pyvenv.cfg" ] || fail "$VENV is not a virtual environment: set RT_ROBOT_OS_VENV to another folder"
  if ! suitable "$PYTHON" || ! "$PYTHON" -m pip --version >/dev/null 2>&1; then
    fail "$VENV does not work as a virtual environment of Python 3.10 to 3.13: remove it, or set RT_ROBOT_OS_VENV"
  fi
}

# ---- what is installed in it -----------------------------------------------------------------

# What is asked of an environment: extras of the table of libraries. A program has its own there,
# and so have the tests.
choose_extras() {
  EXTRAS=(base "$@")
  [ "$KIND" = run ] || PROGRAM=test
}

add_extras_of_program() {
  [ -n "$PROGRAM" ] || return 0
  # shellcheck disable=SC2207
  EXTRAS+=($(table "$1" extras "$PROGRAM"))
  PROGRAM=
}

can_compile() { [ "${RT_ROBOT_OS_COMPILE:-}" != 0 ] && [ -n "$(type -P "${CC:-cc}")" ]; }

# What is no library of the package: ROS, which a sourced installation brings itself, and tools.
requirement_file() {
  local filter='s/x/x/'
  [ "$MODE" = wheels ] || filter='/^ros-jazzy-/d'
  sed -e "$filter" "$ROOT/scripts/requirements-$1.txt"
}

requirements() {
  requirement_file run
  [ "$KIND" = run ] || requirement_file test
  table "$PYTHON" install "${EXTRAS[@]}"
}

# What everything is installed from; each extra that is installed has a stamp with this sum.
requirements_sum() {
  {
    cat "$ROOT/$PACKAGE/base/requirements.py" "$ROOT"/scripts/requirements-*.txt "$ROOT/scripts/constraints-ros.txt"
    version_of "$PYTHON"
  } | sha256sum
}

install_requirements() {
  local sum extra list missing=() options=()
  add_extras_of_program "$PYTHON"
  sum=$(requirements_sum)
  for extra in "${EXTRAS[@]}"; do
    case " ${missing[*]} " in *" $extra "*) continue ;; esac
    if [ -n "$INSTALL_AGAIN" ] || [ "$(cat "$VENV/.$PACKAGE-extra-$extra" 2>/dev/null)" != "$sum" ]; then
      missing+=("$extra")
    fi
  done
  [ "${#missing[@]}" -gt 0 ] || return 0
  say "installing what is needed (${missing[*]}); the first time takes a minute"
  list=$VENV/.$PACKAGE-requirements.txt
  touch "$list" || fail "cannot write to $VENV"
  requirements >"$list" || exit 2
  [ "$MODE" = wheels ] || options=(-c "$ROOT/scripts/constraints-ros.txt")
  [ -z "${RT_ROBOT_OS_CONSTRAINTS:-}" ] || options+=(-c "$RT_ROBOT_OS_CONSTRAINTS")
  # Half of the time would go into compiling what is never imported. Without network pip succeeds
  # as long as nothing is missing.
  PIP_USER=0 logged "$PYTHON" -m pip install --disable-pip-version-check --no-input --retries 3 \
    --no-compile "${options[@]}" -r "$list" || explain_pip_failure "${missing[@]}"
  for extra in "${missing[@]}"; do echo "$sum" >"$VENV/.$PACKAGE-extra-$extra"; done
}

explain_pip_failure() {
  local last
  if grep -qE 'after connection broken by|Could not fetch URL|Network is unreachable' "$LOG"; then
    fail "the Python package index cannot be reached, and not everything is installed ($*):" \
      "check the network and pip's settings, then start again; log: $LOG"
  fi
  if grep -qE 'No matching distribution found for ros-' "$LOG"; then
    fail "there are no ROS 2 Jazzy wheels for this machine ($(uname -m), Python $(version_of "$PYTHON")):" \
      "install ROS 2 Jazzy, source its setup.bash and start again; log: $LOG"
  fi
  last=$(grep '^ERROR' "$LOG" | tail -n 1)
  fail "pip could not install what is needed${last:+ (${last#ERROR: })}; log: $LOG"
}

# ---- the colcon build ------------------------------------------------------------------------

colcon() {
  "$PYTHON" -c 'import sys; from colcon_core.command import main; sys.exit(main())' \
    --log-base "$ROOT/log" "$@"
}

# With --symlink-install the built package is the source itself: an edited module needs no new build.
build_state() {
  printf '%s\n' "$PYTHON" "$ROOT" "$MODE" "${AMENT_PREFIX_PATH:-}"
  version_of "$PYTHON"
  cd "$ROOT" || return
  printf 'compile: %s\n' "${RT_ROBOT_OS_COMPILE:-}" "$(command -v "${CC:-cc}")"
  sha256sum package.xml setup.py setup.cfg
  [ "${RT_ROBOT_OS_COMPILE:-}" = 0 ] || find "$PACKAGE" -name '*.[ch]' -exec sha256sum {} + | LC_ALL=C sort
  if [ -L "build/$PACKAGE/setup.py" ]; then
    package_files -print
  else
    package_files -printf '%p %s %T@\n'
  fi | LC_ALL=C sort
}

# package_files ACTION: of find, on what is installed and was not made here.
package_files() {
  find config launch resource "$PACKAGE" -name __pycache__ -prune -o -type f ! -name '*.so' "$@" 2>/dev/null
}

build() {
  local stamp=$ROOT/build/.$PACKAGE-build
  [ "$(cat "$stamp" 2>/dev/null)" != "$(build_state | sha256sum)" ] || return 0
  say 'building with colcon'
  # A build that another Python made, or that was cut short, is not built upon.
  if [ "$(head -n 1 "$stamp.python" 2>/dev/null)" != "$PYTHON $(version_of "$PYTHON")" ] || [ ! -f "$stamp" ]; then
    rm -rf "${ROOT:?}/build/$PACKAGE" "${ROOT:?}/install/$PACKAGE"
  fi
  rm -f "$stamp"
  logged colcon build --paths "$ROOT" --symlink-install \
    --build-base "$ROOT/build" --install-base "$ROOT/install" ||
    fail "colcon build failed, see $LOG"
  echo "$PYTHON $(version_of "$PYTHON")" >"$stamp.python"
  build_state | sha256sum >"$stamp"
  say "$(PYTHONPATH=$ROOT/build/$PACKAGE "$PYTHON" -c "from $PACKAGE.base.compiled import state; print(state().text)" 2>&1 |
    tail -n 1)"
}

enter() {
  export PATH=${PYTHON%/*}:$PATH
  # The package's own file: the one of the whole installation cannot bear a blank in the path.
  # shellcheck disable=SC1090
  COLCON_CURRENT_PREFIX=$ROOT/install/$PACKAGE . "$ROOT/install/$PACKAGE/share/$PACKAGE/package.bash"
}

# ---- the type of /tf ---------------------------------------------------------------------------

# ROS from wheels has no tf2_msgs. It is generated once, while the package is built on another CPU;
# without a compiler, or when that fails, everything but /tf works.
start_tf2_msgs() {
  TYPES=
  [ "$MODE" = wheels ] && [ ! -e "$VENV/.$PACKAGE-tf2_msgs" ] && [ -w "$VENV" ] && can_compile &&
    [ -n "$(type -P c++ g++ clang++)" ] || return 0
  say 'generating the type of /tf (some seconds, once)'
  "$ROOT/scripts/tf2_msgs" "$VENV" &
  TYPES=$!
  trap 'kill "$TYPES" 2>/dev/null; exit 130' INT
  trap 'kill "$TYPES" 2>/dev/null; exit 143' TERM
}

finish_tf2_msgs() {
  [ -n "$TYPES" ] || return 0
  wait "$TYPES" || say 'note: there will be no /tf; ./scripts/tf2_msgs tries again'
  touch "$VENV/.$PACKAGE-tf2_msgs"
}

# ---- all of it -------------------------------------------------------------------------------

# set_up run|test [EXTRA ...]
set_up() {
  set_up_python "$@"
  TYPES=
  [ "$KIND" = test ] || start_tf2_msgs
  build
  finish_tf2_msgs
  release_lock
  enter
}

# set_up_python run|test [EXTRA ...]: without the package; the caller holds the lock then.
set_up_python() {
  KIND=$1
  shift
  choose_extras "$@"
  trap 'exit 130' INT
  trap 'exit 143' TERM
  [ "$(uname -s)" = Linux ] || fail "this package needs Linux, this is $(uname -s)"
  { mkdir -p "$ROOT/log" && [ -w "$ROOT/log" ]; } 2>/dev/null || fail "cannot write to $ROOT"
  choose_mode
  choose_environment
  hold_lock
  : >"$LOG"
  [ -n "$VENV" ] || return 0
  make_venv
  install_requirements
}

# Two starts at the same time set up one after the other.
hold_lock() {
  local lock=$ROOT/.venv.lock
  exec 9>"$lock" || fail "cannot write to $ROOT"
  if command -v flock >/dev/null && ! flock -n 9; then
    say 'waiting for another start to finish setting up'
    flock 9
  fi
}

release_lock() {
  exec 9>&-
  trap - INT TERM
}
