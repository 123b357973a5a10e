#!/usr/bin/env bash
# Makes the moving picture of the README: the panel on a simulated rig, whose spring becomes twice as stiff half-way.
# Needs Xvfb and ffmpeg.
#
#     cargo build --workspace
#     contrib/moving-picture.sh target/debug docs/first-feeling.gif
set -euo pipefail
programs=$1
picture=$2
seconds=8

folder=$(mktemp -d)
running=()
trap 'kill "${running[@]}" 2>/dev/null || true; rm -rf "$folder"' EXIT

export XDG_STATE_HOME=$folder
"$programs/hbot" server --listen 127.0.0.1:0 >"$folder/server" 2>"$folder/log" &
running+=($!)
Xvfb -displayfd 3 -screen 0 1280x800x24 3>"$folder/display" 2>/dev/null &
running+=($!)

# Waits until `$1` finds something in the file $2, and prints it.
found() {
    for _ in $(seq 200); do
        sed -n "$1" "$2" | grep -m 1 . && return
        sleep 0.1
    done
    echo "never found in $2:" >&2
    cat "$2" >&2
    return 1
}

HBOT_SERVER=$(found 's/.*listen[^0-9]*\(127\.0\.0\.1:[0-9]*\).*/\1/p' "$folder/server")
DISPLAY=:$(found 's/^\([0-9]\+\)$/\1/p' "$folder/display")
export HBOT_SERVER DISPLAY
# `--observe` leaves the lease to `hbot set`. Without a window manager the window has the corner of the screen.
LIBGL_ALWAYS_SOFTWARE=1 "$programs/hbot-gui" --server "$HBOT_SERVER" --theme light --observe --size 1280x800 2>"$folder/panel" &
running+=($!)
# The plots show ten seconds: wait until they are full.
sleep 14

(sleep $((seconds / 2)) && "$programs/hbot" set spring stiffness=2 >/dev/null) &
ffmpeg -loglevel error -y -f x11grab -draw_mouse 0 -framerate 10 -video_size 1280x800 -i "$DISPLAY" -t "$seconds" \
    -c:v ffv1 "$folder/raw.mkv"
# The palette is made from the frames themselves, so that 64 colours suffice.
ffmpeg -loglevel error -y -i "$folder/raw.mkv" -filter_complex \
    'scale=800:-1:flags=lanczos,split[a][b];[a]palettegen=max_colors=64[p];[b][p]paletteuse=dither=none:diff_mode=rectangle' \
    "$picture"
ls -l "$picture"
