# Written by stubs.py from what the perturbations say of themselves; changes here are lost.
"""One function for each perturbation of pdk, with its parameters: they return what `pdk.perturb` and others take."""

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any, Literal, TypeAlias

#: A perturbation with its intensity, parameters and modifiers.
Applied: TypeAlias = dict[str, Any]
#: Any number from 0 to 4, or a course over time.
Level: TypeAlias = float | Mapping[str, Any]
#: A number, or one for each of the five levels.
ByLevel: TypeAlias = float | Sequence[float]

MODIFIERS: tuple[str, ...]

def adversarial_patch(
    level: Level = 2.0,
    *,
    picture: str | PathLike[str] | None = None,
    show: Literal["picture", "mean", "grey"] | None = None,
    on: Literal["road", "frame"] | None = None,
    pose: Literal["flat", "upright"] | None = None,
    depth: Literal["none", "simulator"] | None = None,
    size: ByLevel | None = None,
    stretch: float | None = None,
    distance: float | None = None,
    spacing: float | None = None,
    offset: float | None = None,
    turn: float | None = None,
    above: float | None = None,
    speed: float | None = None,
    share: ByLevel | None = None,
    across: float | None = None,
    down: float | None = None,
    field_of_view: float | None = None,
    camera_height: float | None = None,
    camera_pitch: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lays a picture on the road ahead or over a part of the frame, such as one that was trained so that a network
    steers elsewhere.

    picture: the picture, as `pdk attack patch` and `pdk attack drives` write one, or any other; or `dave2_patch`,
        which is part of pdk.
    show: picture: as it is; mean and grey: a plain patch to compare it with, of its mean colour or of the grey 128
        (default "picture").
    on: where it lies: on the road, or over a box of the frame (default "road").
    pose: flat: it lies on the road; upright: it faces the camera, like a sign or the back of a vehicle; only with
        `on=road` (default "flat").
    depth: none: it is drawn over everything; simulator: what is nearer hides it, as the simulator knows distances;
        only with `on=road` (default "none").
    size: its width; only with `on=road` (m; 0.01 to 20; by level 0.5, 1, 1.5, 2, 3).
    stretch: how much longer it is along the road than its shape says, as markings are that are read at a flat
        angle; only with `pose=flat` (0.1 to 20; default 3.0).
    distance: how far ahead of the camera its middle lies; with a `spacing`, that of the first one at the start;
        only with `on=road` (m; 0.5 to 60; default 10.0).
    spacing: how far apart pictures lie on the way of the vehicle, which drives over them; with 0, one stays ahead
        of it; only with `on=road` (m; 0 to 1000; default 0.0).
    offset: how far to the right of the camera its middle lies; only with `on=road` (m; -10 to 10; default 0.0).
    turn: by how much it is turned to the right on the road; only with `pose=flat` (degrees; -180 to 180; default
        0.0).
    above: how high above the road its middle is; only with `pose=upright` (m; 0 to 20; default 1.0).
    speed: how fast the vehicle drives where its way is not known, as in recordings; only with `on=road` (m/s; 0 to
        100; default 8.0).
    share: its width as a share of the frame's; only with `on=frame` (0.001 to 1; by level 0.05, 0.1, 0.15, 0.2,
        0.3).
    across: where its middle lies from the left of the frame to the right; only with `on=frame` (0 to 1; default
        0.5).
    down: where its middle lies from the top of the frame to the bottom; only with `on=frame` (0 to 1; default 0.7).
    field_of_view: angle that the frame's width covers (degrees; 20 to 130; default 75.0).
    camera_height: height of the camera above the road (m; 0.1 to 10; default 1.35).
    camera_pitch: angle by which the camera looks down (degrees; -45 to 45; default 8.0).
    Source: Brown et al., Adversarial Patch, 2017; Sato et al., Dirty Road Can Attack, 2021.
    Not part of the default set.
    """

def artistic(
    level: Level = 2.0,
    *,
    style: Literal["brush", "dots", "ink", "mosaic", "pencil", "swirls"] | None = None,
    strength: ByLevel | None = None,
    fit: Literal["scale", "tile"] | None = None,
    overlap: float | None = None,
    engine: Literal["auto", "pdk", "onnxruntime"] | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Repaints the frame in one of six styles of art, by a network.

    style: the style, each after a picture that the recipe draws (default "brush").
    strength: how much of the result is the network's (0 to 1; by level 0.2, 0.4, 0.6, 0.8, 1).
    fit: scale: the frame is brought to the size of the network's image and the result back; tile: the network sees
        the frame piece by piece at its own resolution, for frames that are not smaller than its image (default
        "scale").
    overlap: the share of a tile by which it reaches into the next; only with `fit=tile` (0 to 0.5; default 0.25).
    engine: who runs the network, which gives the same result on each engine: auto is onnxruntime if it is
        installed, else pdk (default "auto").
    Source: Dumoulin et al., A Learned Representation for Artistic Style, 2017.
    Not part of the default set.
    """

def banding(
    level: Level = 2.0,
    *,
    depth: ByLevel | None = None,
    flicker: float | None = None,
    drift: float | None = None,
    readout: float | None = None,
    exposure: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Dark bands of flickering lamps under a rolling shutter, which roll with the beat of mains and frame rate.

    depth: How much of the lamps' light is missing between two of their peaks (0 to 1; by level 0.15, 0.3, 0.45,
        0.6, 0.75).
    flicker: How often the lamps flicker nominally: twice the mains frequency (Hz; 0 to 1000; default 100.0).
    drift: Largest deviation from `flicker`; each sequence draws between half of it and all of it (Hz; 0 to 10;
        default 0.4).
    readout: How long the camera takes from the first row to the last (s; 0 to 1; default 0.03).
    exposure: How long each row gathers light; the longer, the fainter the bands (s; 0 to 1; default 0.003).
    Source: Light of lamps on the mains as a raised cosine, integrated over the exposure e of each row of a rolling
        shutter.
    """

def biased_speed(
    level: Level = 2.0,
    *,
    share: ByLevel | None = None,
    offset: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Tells the driver a speed that is too low, or too high, by a share of it.

    share: by which share the speed is too high; below 0 it is too low, so that a driver that holds a speed goes
        faster (-1 to 5; by level -0.05, -0.1, -0.2, -0.35, -0.5).
    offset: what is added to the speed (m/s; -100 to 100; default 0.0).
    Source: Offset errors of sensors in ISO 26262-5:2018, annex D; a share is what wheels of another circumference
        make of it.
    Not part of the default set.
    """

def bit_errors(
    level: Level = 2.0,
    *,
    errors: ByLevel | None = None,
    coarseness: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Compresses the frame and lets some bits of the stream arrive wrong: colours and blocks go wrong up to the end of
    a slice, and what cannot be decoded is that of the frame before.

    errors: probability that a bit is wrong (0 to 0.1; by level 5e-06, 2e-05, 8e-05, 0.0003, 0.001).
    coarseness: multiple of the quantisation steps of the standard's annex, to 0.01; steps end at 255; 0.5 is a
        quality of 75 as JPEG has it (0.02 to 25; default 0.5).
    Source: Binary symmetric channel of Shannon (1948); an intra codec of the kind of ITU-T T.81 with codes of
        Golomb (1966), slices, and concealment by the frame before, as decoders of H.264 do.
    Not part of the default set.
    """

def blank_frames(
    level: Level = 2.0,
    *,
    lost: ByLevel | None = None,
    burst: ByLevel | None = None,
    brightness: int | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Shows a black picture in place of frames that are lost.

    lost: share of the frames that are lost; 1 of 41 arrives in any case (0 to 1; by level 0.05, 0.1, 0.2, 0.3,
        0.5).
    burst: how many frames are lost in a row, on average; no fewer than if each were lost by itself, and never more
        than 40 (frames; 1 to 40; by level 1, 1.5, 2, 3, 5).
    brightness: grey of the picture that is shown: 0 is black, 255 white (0 to 255; default 0).
    Source: Burst losses as in Gilbert, Capacity of a burst-noise channel (1960).
    Not part of the default set.
    """

def canny_edges_mapping(
    level: Level = 2.0,
    *,
    low_threshold: ByLevel | None = None,
    high_threshold: ByLevel | None = None,
    weight: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Darkens the frame and marks its edges in red; higher levels mark fewer, as published.

    low_threshold: gradient (Sobel, |dx| + |dy|) above which a pixel continues an edge (0 to 2040; by level 51, 60,
        75, 90, 120).
    high_threshold: gradient above which a pixel starts an edge (0 to 2040; by level 151, 160, 175, 190, 220).
    weight: share of the edges, red on black, in the result (0 to 1; by level 0.3, 0.3, 0.3, 0.3, 0.3).
    Source: Canny, A computational approach to edge detection (1986).
    """

def condensation(
    level: Level = 2.0,
    *,
    density: ByLevel | None = None,
    growth: ByLevel | None = None,
    wipe: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Mists the glass in front of the camera up, more and more, until a wiper passes and it begins again.

    density: share of the mist where most of it has settled (0 to 1; by level 0.35, 0.55, 0.75, 0.9, 1).
    growth: how long it takes until 63 % of it is there (s; 0.01 to 10000; by level 12, 8, 5, 3, 2).
    wipe: how often the wiper passes; 0 for never, with the mist that has grown in a minute (s; 0 to 10000; default
        10.0).
    Source: Condensation is among the camera failures of Secci and Ceccarelli, On failures of RGB cameras and their
        effects in autonomous driving applications (2020); it grows as the difference to saturation falls.
    Not part of the default set.
    """

def contrast(
    level: Level = 2.0,
    *,
    factor: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Spreads all values away from the middle grey.

    factor: factor of the distance from the middle grey; below 1 it lowers contrast (0 to 10; by level 1.1, 1.2,
        1.3, 1.5, 1.7).
    Source: Linear map about 127.5, clipped.
    """

def cutout_filter(
    level: Level = 2.0,
    *,
    rectangles: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Blackens rectangles, at places that stay for a sequence.

    rectangles: number of rectangles, rounded to the nearest whole number; their sides are 5 % to 20 % of the
        frame's (0 to 10000; by level 1, 2, 4, 6, 10).
    Source: DeVries and Taylor, Improved regularization of convolutional neural networks with cutout (2017).
    """

def defective_pixels(
    level: Level = 2.0,
    *,
    share: ByLevel | None = None,
    lines: ByLevel | None = None,
    show: Literal["any", "hot", "dead"] | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Makes photosites of the sensor dead, hot or stuck, and rows and columns as well, each of which spreads to its
    neighbours where colours are interpolated.

    share: share of the photosites that are defective (0 to 0.2; by level 0.0002, 0.001, 0.004, 0.015, 0.05).
    lines: how many rows, and how many columns, are defective (0 to 32; by level 0, 1, 2, 4, 8).
    show: what defects show: any: white, black or a value at which they are stuck; hot: white; dead: black (default
        "any").
    Source: Hot, dead and stuck pixels as in EMVA 1288; bilinear interpolation of the pattern of Bayer, US patent
        3971065 (1976).
    Not part of the default set.
    """

def defocus_blur(
    level: Level = 2.0,
    *,
    radius: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Replaces every pixel by the mean of the disc around it.

    radius: radius of the disc; the disc grows pixel by pixel between whole numbers too (px; 0 to 100; by level 2,
        5, 6, 9, 12).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    """

def delayed_frames(
    level: Level = 2.0,
    *,
    delay: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Shows the frame of some time ago, as if the camera were late.

    delay: how much later the driver sees a frame; at most 60 frames (s; 0 to 1; by level 0.05, 0.1, 0.2, 0.35,
        0.5).
    Source: Constant latency between exposure and decision.
    Not part of the default set.
    """

def dirty_lens(
    level: Level = 2.0,
    *,
    smudges: ByLevel | None = None,
    opacity: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Blurred smudges of dirt on the lens.

    smudges: How many smudges there are (0 to 200; by level 4, 7, 11, 16, 22).
    opacity: How much of the picture the densest smudge hides (0 to 1; by level 0.45, 0.55, 0.65, 0.75, 0.85).
    Source: Out-of-focus dirt as an opacity blurred by a Gaussian of about 1/40 of the frame's height.
    """

def dotted_lines_mapping(
    level: Level = 2.0,
    *,
    severity: ByLevel | None = None,
    variant: Literal["published", "corrected"] | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Draws dotted black lines, at places that stay for a sequence.

    severity: s: dots lie 50 * (1 - s) pixels apart, at least 10, and have a radius of 5 * s pixels without its
        fraction; the variant says how many lines there are (0 to 1; by level 0.1, 0.2, 0.3, 0.4, 0.5).
    variant: published: 100 * s - 10 lines, none at level 0; corrected: 100 * s lines (default "published").
    Source: Leonhard, Lambertenghi and Stocco, PerturbationDrive: dots along random lines.
    """

def drifting_clock(
    level: Level = 2.0,
    *,
    rate: ByLevel | None = None,
    offset: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Tells the driver a time that runs off.

    rate: by which share the clock is fast; below 0 it is slow (-0.9 to 10; by level 0.0001, 0.001, 0.01, 0.05,
        0.2).
    offset: how far it is ahead at the start (s; -100000 to 100000; default 0.0).
    Source: Frequency error of an oscillator, as in IEEE 1139; quartz without synchronisation runs off by 1e-5 to
        1e-4, the higher levels are those of a clock that counts wrongly.
    Not part of the default set.
    """

def drifting_speed(
    level: Level = 2.0,
    *,
    drift: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Tells the driver a speed whose error grows over time.

    drift: how much the error grows in a second; below 0 the speed is too low, so that a driver that holds a speed
        goes faster (m/s²; -100 to 100; by level -0.02, -0.05, -0.1, -0.2, -0.4).
    Source: Drift of sensors in ISO 26262-5:2018, annex D.
    Not part of the default set.
    """

def dynamic_lightning_filter(
    level: Level = 2.0,
    *,
    opacity: ByLevel | None = None,
    fit: Literal["cover", "stretch"] | None = None,
    loop: Literal["repeat", "cross-fade", "ping-pong"] | None = None,
    rate: float | None = None,
    horizon: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lays bolts of lightning over the frame, moving in simulation time in a loop of 10 s, in 40 % of which one shows;
    otherwise the frame stays as it is.

    opacity: how visible the clip is, in steps of 1/256; 1 as in the clip (0 to 1; by level 0.2, 0.4, 0.6, 0.8, 1).
    fit: cover: the clip keeps its shape, and what sticks out of the frame is cut off; stretch: it takes the shape
        of the frame, as published (default "cover").
    loop: cross-fade: the last half second fades into the first; ping-pong: the clip runs back to its beginning;
        repeat: it starts again (default "repeat").
    rate: frames of the clip per second of simulation time; 0: the clip's own, or, if the clip follows the vehicle's
        speed, what that makes of it (Hz; 0 to 1000; default 0.0).
    horizon: where the horizon is in the frame, as a share of its height from the top: the clip is laid so that its
        own lies there, and enlarged as far as that takes; not with fit=stretch (0 to 1; default 0.32).
    Source: A loop over a green screen, drawn by this project.
    """

def dynamic_object_overlay(
    level: Level = 2.0,
    *,
    opacity: ByLevel | None = None,
    fit: Literal["cover", "stretch"] | None = None,
    loop: Literal["repeat", "cross-fade", "ping-pong"] | None = None,
    rate: float | None = None,
    horizon: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lays birds in flight above the horizon over the frame, moving in simulation time in a loop of 4 s.

    opacity: how visible the clip is, in steps of 1/256; 1 as in the clip (0 to 1; by level 0.2, 0.4, 0.6, 0.8, 1).
    fit: cover: the clip keeps its shape, and what sticks out of the frame is cut off; stretch: it takes the shape
        of the frame, as published (default "cover").
    loop: cross-fade: the last half second fades into the first; ping-pong: the clip runs back to its beginning;
        repeat: it starts again (default "repeat").
    rate: frames of the clip per second of simulation time; 0: the clip's own, or, if the clip follows the vehicle's
        speed, what that makes of it (Hz; 0 to 1000; default 0.0).
    horizon: where the horizon is in the frame, as a share of its height from the top: the clip is laid so that its
        own lies there, and enlarged as far as that takes; not with fit=stretch (0 to 1; default 0.32).
    Source: A loop over a green screen, drawn by this project.
    """

def dynamic_rain_filter(
    level: Level = 2.0,
    *,
    opacity: ByLevel | None = None,
    fit: Literal["cover", "stretch"] | None = None,
    loop: Literal["repeat", "cross-fade", "ping-pong"] | None = None,
    rate: float | None = None,
    horizon: float | None = None,
    haze: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lays streaks of rain over the frame, moving in simulation time in a loop of 3 s.

    opacity: how visible the clip is, in steps of 1/256; 1 as in the clip (0 to 1; by level 0.2, 0.4, 0.6, 0.8, 1).
    fit: cover: the clip keeps its shape, and what sticks out of the frame is cut off; stretch: it takes the shape
        of the frame, as published (default "cover").
    loop: cross-fade: the last half second fades into the first; ping-pong: the clip runs back to its beginning;
        repeat: it starts again (default "repeat").
    rate: frames of the clip per second of simulation time; 0: the clip's own, or, if the clip follows the vehicle's
        speed, what that makes of it (Hz; 0 to 1000; default 0.0).
    horizon: where the horizon is in the frame, as a share of its height from the top: the clip is laid so that its
        own lies there, and enlarged as far as that takes; not with fit=stretch (0 to 1; default 0.32).
    haze: the share of the distant scene that the air hides, at an opacity of 1 (0 to 1; default 0.45).
    Source: A loop over a green screen, drawn by this project.
    """

def dynamic_smoke_filter(
    level: Level = 2.0,
    *,
    opacity: ByLevel | None = None,
    fit: Literal["cover", "stretch"] | None = None,
    loop: Literal["repeat", "cross-fade", "ping-pong"] | None = None,
    rate: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lays swathes of smoke over the frame, moving in simulation time in a loop of 4 s.

    opacity: how visible the clip is, in steps of 1/256; 1 as in the clip (0 to 1; by level 0.2, 0.4, 0.6, 0.8, 1).
    fit: cover: the clip keeps its shape, and what sticks out of the frame is cut off; stretch: it takes the shape
        of the frame, as published (default "cover").
    loop: cross-fade: the last half second fades into the first; ping-pong: the clip runs back to its beginning;
        repeat: it starts again (default "repeat").
    rate: frames of the clip per second of simulation time; 0: the clip's own, or, if the clip follows the vehicle's
        speed, what that makes of it (Hz; 0 to 1000; default 0.0).
    Source: A loop over a green screen, drawn by this project.
    """

def dynamic_snow_filter(
    level: Level = 2.0,
    *,
    opacity: ByLevel | None = None,
    fit: Literal["cover", "stretch"] | None = None,
    loop: Literal["repeat", "cross-fade", "ping-pong"] | None = None,
    rate: float | None = None,
    horizon: float | None = None,
    haze: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lays flakes of snow over the frame, moving in simulation time in a loop of 4 s.

    opacity: how visible the clip is, in steps of 1/256; 1 as in the clip (0 to 1; by level 0.2, 0.4, 0.6, 0.8, 1).
    fit: cover: the clip keeps its shape, and what sticks out of the frame is cut off; stretch: it takes the shape
        of the frame, as published (default "cover").
    loop: cross-fade: the last half second fades into the first; ping-pong: the clip runs back to its beginning;
        repeat: it starts again (default "repeat").
    rate: frames of the clip per second of simulation time; 0: the clip's own, or, if the clip follows the vehicle's
        speed, what that makes of it (Hz; 0 to 1000; default 0.0).
    horizon: where the horizon is in the frame, as a share of its height from the top: the clip is laid so that its
        own lies there, and enlarged as far as that takes; not with fit=stretch (0 to 1; default 0.32).
    haze: the share of the distant scene that the air hides, at an opacity of 1 (0 to 1; default 0.5).
    Source: A loop over a green screen, drawn by this project.
    """

def dynamic_sun_filter(
    level: Level = 2.0,
    *,
    opacity: ByLevel | None = None,
    fit: Literal["cover", "stretch"] | None = None,
    loop: Literal["repeat", "cross-fade", "ping-pong"] | None = None,
    rate: float | None = None,
    horizon: float | None = None,
    darker: float | None = None,
    veil: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lays glare of a low sun over the frame, moving in simulation time in a loop of 4 s; the sun turns with the
    vehicle in a bend, because a perturbation does not know the vehicle's heading.

    opacity: how visible the clip is, in steps of 1/256; 1 as in the clip (0 to 1; by level 0.2, 0.4, 0.6, 0.8, 1).
    fit: cover: the clip keeps its shape, and what sticks out of the frame is cut off; stretch: it takes the shape
        of the frame, as published (default "cover").
    loop: cross-fade: the last half second fades into the first; ping-pong: the clip runs back to its beginning;
        repeat: it starts again (default "repeat").
    rate: frames of the clip per second of simulation time; 0: the clip's own, or, if the clip follows the vehicle's
        speed, what that makes of it (Hz; 0 to 1000; default 0.0).
    horizon: where the horizon is in the frame, as a share of its height from the top: the clip is laid so that its
        own lies there, and enlarged as far as that takes; not with fit=stretch (0 to 1; default 0.32).
    darker: the share of the light that the camera takes away, at an opacity of 1 (0 to 1; default 0.35).
    veil: the light scattered over the frame as a share of white, at an opacity of 1 (0 to 1; default 0.09).
    Source: A loop over a green screen, drawn by this project.
    """

def elastic(
    level: Level = 2.0,
    *,
    alpha: ByLevel | None = None,
    sigma: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Displaces every pixel at random, smoothly, anew in every frame; level 0 is stronger than 1 to 3.

    alpha: largest displacement in each direction before smoothing (px; 0 to 1000; by level 2, 3, 5, 7, 10).
    sigma: standard deviation of the Gaussian that smooths the displacements; the larger, the less is left of them
        (px; 0.1 to 20; by level 0.4, 0.75, 0.9, 1.2, 1.5).
    Source: Simard, Steinkraus and Platt, Best practices for convolutional neural networks applied to visual
        document analysis (2003).
    """

def exposure_hunting(
    level: Level = 2.0,
    *,
    swing: ByLevel | None = None,
    period: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lets the exposure swing around its aim, as automatic exposure does that corrects too much and too late.

    swing: how far the exposure swings to either side (stops; 0 to 8; by level 0.3, 0.6, 1, 1.5, 2.2).
    period: how long a swing and the one back take (s; 0.02 to 1000; default 1.6).
    Source: Oscillation of a control loop with too much gain and dead time; exposure in stops, light by IEC
        61966-2-1 (sRGB).
    Not part of the default set.
    """

def false_color_filter(
    level: Level = 2.0,
    *,
    effect: ByLevel | None = None,
    variant: Literal["published", "corrected"] | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Exchanges, inverts or adds channels; the levels are different effects, of which level 3 is the strongest.

    effect: 0: green, blue, red; 1: green, red, blue; 2: blue, green, red; 3: inverted; 4: half the sums of
        neighbouring channels; in between, a blend of two (0 to 4; by level 0, 1, 2, 3, 4).
    variant: published: the sums of effect 4 wrap at 256, so what is bright comes out dark; corrected: they do not
        (default "published").
    Source: Leonhard, Lambertenghi and Stocco, PerturbationDrive: channels exchanged, inverted and added.
    """

def fgsm(
    level: Level = 2.0,
    *,
    epsilon: ByLevel | None = None,
    norm: Literal["linf", "l2"] | None = None,
    goal: Literal["away", "left", "right", "target"] | None = None,
    target: float | None = None,
    expectation: Literal["none", "changes"] | None = None,
    changes: int | None = None,
    shift: float | None = None,
    blur: float | None = None,
    brightness: float | None = None,
    noise: float | None = None,
    model: str | PathLike[str] | None = None,
    engine: Literal["pdk", "auto", "onnxruntime"] | None = None,
    preset: Literal["auto", "dave2", "udacity", "donkeycar_linear", "donkeycar_categorical", "donkeycar_memory", "donkeycar_rnn", "donkeycar_3d"] | None = None,
    crop: Any | None = None,
    image_size: Any | None = None,
    resize: Literal["auto", "bilinear", "nearest", "area", "bicubic", "pil_bilinear", "pil_bicubic", "linear"] | None = None,
    color: Literal["auto", "rgb", "bgr", "grey", "yuv", "hsv"] | None = None,
    scale: Any | None = None,
    mean: Any | None = None,
    std: Any | None = None,
    layout: Literal["auto", "nchw", "nhwc", "ntchw", "nthwc", "ncthw"] | None = None,
    dtype: Literal["auto", "float32", "float16", "uint8", "int8"] | None = None,
    frames: Any | None = None,
    spacing: Any | None = None,
    order: Literal["auto", "oldest_first", "newest_first"] | None = None,
    start: Literal["auto", "repeat", "zeros"] | None = None,
    differences: Literal["auto", "none", "only", "both"] | None = None,
    inputs: Any | None = None,
    state: Any | None = None,
    steering: Any | None = None,
    throttle: Any | None = None,
    waypoints: Any | None = None,
    speed: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Changes each pixel a little so that a network steers elsewhere, by one step along the gradient of its steering.

    epsilon: the size of the change: with `norm=linf` no value changes by more than this, rounded down; with
        `norm=l2` the root of the mean square of all changes is at most this (grey levels of 255; 0 to 255; by level
        1, 2, 4, 8, 16).
    norm: how the size of the change is measured: linf by its largest value, l2 by the root of the mean square over
        all values (default "linf").
    goal: where the network is to steer: away from what it gives for the frame as it is, on whichever side that is
        further; left; right; or to `target` (default "away").
    target: the steering that the network is to give, from -1 for left to 1 for right; only with `goal=target` (-1
        to 1; default 0.0).
    expectation: over what the steering and its gradient are averaged: over nothing, so that the network sees the
        frame as it is, or over drawn changes of it, so that the attack survives such changes (default "none").
    changes: over how many drawn changes of a frame the mean is taken; only with `expectation=changes` (1 to 1000;
        default 8).
    shift: how far a drawn change moves the frame at most along each axis, rounded down; only with
        `expectation=changes` (pixels; 0 to 100; default 2.0).
    blur: the largest standard deviation of the Gaussian blur of a drawn change; only with `expectation=changes`
        (pixels; 0 to 20; default 1.0).
    brightness: by which share a drawn change makes all values greater or smaller at most; only with
        `expectation=changes` (0 to 1; default 0.2).
    noise: the standard deviation of the noise of a drawn change; only with `expectation=changes` (grey levels of
        255; 0 to 255; default 8.0).
    model: the ONNX file of the network that is attacked, or the name of a network that is part of pdk; it need not
        be the driver.
    engine: who runs the network: pdk computes the same on every processor; onnxruntime is ONNX Runtime, which has
        to be installed, knows more operators, and computes as the processor lets it; auto is onnxruntime if it is
        installed, else pdk. A scenario records the engine with its version, such as pdk 1 (default "pdk").
    preset: a description that has a name; fields beside it override its fields; auto: as the file beside the model
        says, or none (default "auto").
    crop: what is cut off at each side: whole numbers are pixels, numbers below 1 are shares ({ top = 60, bottom =
        25, left = 0, right = 0 }); left out: as the file beside the model says, or nothing.
    image_size: the size of the network's image, which a file may leave open ([width, height]); left out: as the
        file beside the model says, or as the file declares.
    resize: the filter: bilinear, area and bicubic are OpenCV's, nearest, pil_bilinear and pil_bicubic are PIL's and
        torchvision's, and linear is pdk's own; auto: as the file beside the model says, or bilinear (default
        "auto").
    color: what the channels are, by OpenCV's 8-bit conversions: yuv is COLOR_RGB2YUV, hsv is COLOR_RGB2HSV with hue
        from 0 to 179; auto: as the file beside the model says, or rgb, or grey for one channel (default "auto").
    scale: the range to which bytes are brought, or the factor on them ("0..255", "0..1", "-1..1", another range, or
        a factor); left out: as the file beside the model says, or 0..255.
    mean: what is subtracted after the scale (a number, or one for each channel); left out: as the file beside the
        model says, or 0.
    std: what is divided by after that (a number, or one for each channel); left out: as the file beside the model
        says, or 1.
    layout: the order of the image's axes: batch n, time t, channels c, height h, width w; frames of a stack are
        joined along t, or along c if there is no t; auto: as the file beside the model says, or by the shape
        (default "auto").
    dtype: the type of the image's numbers; bytes are rounded to the nearest; auto: as the file beside the model
        says, or as the file declares (default "auto").
    frames: how many frames the image stacks (a whole number); left out: as the file beside the model says, or 1, or
        the length of axis t.
    spacing: the distance between stacked frames, in frames (a whole number); left out: as the file beside the model
        says, or 1.
    order: the order of stacked frames; auto: as the file beside the model says, or oldest_first (default "auto").
    start: what stands for frames before the first of a sequence: the first, or zeros; auto: as the file beside the
        model says, or repeat (default "auto").
    differences: whether the stack holds the differences of neighbouring frames: only them (one fewer than frames),
        or the newest frame followed by them; auto: as the file beside the model says, or none (default "auto").
    inputs: what each input gets: the image; the speed, as { value = "speed", unit = "km/h", scale = 1, offset = 0,
        assumed = 8 }, where assumed is in m/s and stands for a speed that is not known; the controls before, as {
        value = "controls" }; or constants ({ NAME = "image", "speed", "controls", a number, a list or a table });
        left out: as the file beside the model says, or by name and shape.
    state: inputs that get what an output was at the frame before, and zeros at the first ({ INPUT = "OUTPUT" });
        left out: as the file beside the model says, or NAME_in and NAME_out.
    steering: the output that steers, or { output = "NAME", index = 0, bins = { from = -1, to = 1, count = 15 },
        decode = "argmax", scale = 1, offset = 0, clip = [-1, 1] }; bins may be a list of values; decode may also be
        mean, or softmax_mean for logits ("OUTPUT" or a table); left out: as the file beside the model says, or the
        first output.
    throttle: the output that gives the throttle, likewise; a number is a constant throttle ("OUTPUT", a table or a
        number); left out: as the file beside the model says, or the second output or number, or 0.3.
    waypoints: the output with the waypoints of a network that plans: what their numbers are, the seconds between
        them, and wheelbase in metres and full lock in degrees of the vehicle that follows them ({ output =
        "waypoints", axes = "forward_left", interval = 0.5, wheelbase = 2.6, full_lock = 25 }); left out: as the
        file beside the model says, or the network steers.
    speed: the speed that is given to a network with a speed input where the real one is not known, as for pictures
        (m/s; 0 to 100; default 8.0).
    Source: Goodfellow et al., Explaining and Harnessing Adversarial Examples, 2015; `expectation`: Athalye et al.,
        Synthesizing Robust Adversarial Examples, 2018.
    Not part of the default set.
    """

def flicker(
    level: Level = 2.0,
    *,
    depth: ByLevel | None = None,
    frequency: float | None = None,
    readout: float | None = None,
    exposure: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lights the scene with lamps that flicker, so that bright and dark bands wander through the frame as its rows are
    read.

    depth: how much the light of the lamps goes up and down, as a share of its mean (0 to 1; by level 0.1, 0.2, 0.4,
        0.65, 1).
    frequency: how often the lamps flicker: twice the frequency of the mains (Hz; 0.1 to 10000; default 100.0).
    readout: how long it takes to read all rows (s; 0 to 1; default 0.02).
    exposure: how long a row is exposed, which evens the flicker out (s; 0 to 1; default 0.004).
    Source: Modulation of lamps as in IEEE 1789-2015, read by a rolling shutter; light by IEC 61966-2-1 (sRGB).
    Not part of the default set.
    """

def fog_by_visibility(
    level: Level = 2.0,
    *,
    visibility: ByLevel | None = None,
    of: Literal["fog", "dust"] | None = None,
    air: float | None = None,
    depth: Literal["ground", "simulator"] | None = None,
    field_of_view: float | None = None,
    camera_height: float | None = None,
    camera_pitch: float | None = None,
    beyond: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Puts fog or dust between the camera and the scene that leaves a visibility in metres, so that what is further
    away fades more.

    visibility: how far one sees: fog begins at 1000 m, and is dense below 200 m and very dense below 50 m (m; 1 to
        100000; by level 1000, 500, 200, 100, 50).
    of: what is in the air: grey fog, or dust, which is brown (default "fog").
    air: grey of the fog itself: 0 is black, 255 white (0 to 255; default 205.0).
    depth: where distances come from: ground: what is below the horizon lies on a plane, and all above it is
        `beyond` away; simulator: as the simulator knows them (default "ground").
    field_of_view: angle that the frame's width covers (degrees; 20 to 130; default 75.0).
    camera_height: height of the camera above the road (m; 0.1 to 10; default 1.35).
    camera_pitch: angle by which the camera looks down (degrees; -45 to 45; default 8.0).
    beyond: how far away everything above the horizon is, and the furthest that the ground is; only with
        `depth=ground` (m; 1 to 100000; default 150.0).
    Source: Koschmieder, Theorie der horizontalen Sichtweite (1924); the visibility is the meteorological optical
        range of the WMO, at which 5 % of the light is left; light by IEC 61966-2-1 (sRGB).
    Not part of the default set.
    """

def fog_filter(
    level: Level = 2.0,
    *,
    strength: ByLevel | None = None,
    noise: ByLevel | None = None,
    variant: Literal["published", "corrected"] | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Blends the frame with white and some noise, drawn anew for every frame; it brightens more than it hides.

    strength: share of the fog in the result (0 to 1; by level 0.1, 0.2, 0.3, 0.45, 0.65).
    noise: share of the noise in the fog, and its standard deviation as a share of 255 (0 to 1; by level 0.05, 0.1,
        0.2, 0.3, 0.45).
    variant: published: noise below 0 wraps round to bright values; corrected: it is clipped to 0 (default
        "published").
    Source: Weighted sum of the frame, white and normal noise.
    """

def fog_mapping(
    level: Level = 2.0,
    *,
    strength: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Blends the frame with a grey fractal field, the same one in all frames of a sequence.

    strength: share of the field in the result (0 to 1; by level 0.05, 0.12, 0.22, 0.35, 0.6).
    Source: Fournier, Fussell and Carpenter, Computer rendering of stochastic models (1982); randomness does not
        decay with scale.
    Not part of the default set.
    """

def frost_filter(
    level: Level = 2.0,
    *,
    opacity: ByLevel | None = None,
    variant: Literal["published", "corrected"] | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lays a texture of ice crystals over the frame, the same one always, and lowers saturation.

    opacity: opacity of the texture where it covers what is behind it (0 to 1; by level 0.15, 0.19, 0.25, 0.32,
        0.4).
    variant: published: the texture is opaque, so the whole frame is blended with it; corrected: it covers as much
        as there is of it (default "published").
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019), with a drawn texture.
    """

def frozen_frames(
    level: Level = 2.0,
    *,
    lost: ByLevel | None = None,
    burst: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Repeats the last frame that arrived while frames are lost, so that the picture freezes.

    lost: share of the frames that are lost; 1 of 41 arrives in any case (0 to 1; by level 0.1, 0.2, 0.35, 0.5,
        0.7).
    burst: how many frames are lost in a row, on average; no fewer than if each were lost by itself, and never more
        than 40 (frames; 1 to 40; by level 2, 4, 6, 10, 16).
    Source: Burst losses as in Gilbert, Capacity of a burst-noise channel (1960); frozen frames are among the camera
        failures of Secci and Ceccarelli, On failures of RGB cameras and their effects in autonomous driving
        applications (2020).
    Not part of the default set.
    """

def gaussian_blur(
    level: Level = 2.0,
    *,
    kernel_size: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Smooths with a Gaussian kernel.

    kernel_size: width of the kernel, rounded to the nearest odd number (px; 1 to 99; by level 3, 7, 15, 25, 41).
    Source: Gaussian filter with 8-bit weights and standard deviation 0.3 * ((size - 1) / 2 - 1) + 0.8.
    """

def gaussian_noise(
    level: Level = 2.0,
    *,
    sigma: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Adds normally distributed noise to every value, anew in every frame.

    sigma: standard deviation of the noise (of full scale; 0 to 1; by level 0.03, 0.06, 0.12, 0.18, 0.22).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    """

def ghosting(
    level: Level = 2.0,
    *,
    persistence: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lets earlier frames shine through, each less than the one after it, so that what moves leaves a trail.

    persistence: share of what was there before in what is shown (0 to 0.99; by level 0.2, 0.4, 0.55, 0.7, 0.85).
    Source: A recursive filter over time, as in the noise reduction of image signal processors, cut after twelve
        frames.
    Not part of the default set.
    """

def glass_blur(
    level: Level = 2.0,
    *,
    distance: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Gives every pixel the colour of a random pixel nearby, the same one in all frames of a sequence.

    distance: largest distance in each direction, every whole number of pixels up to it equally likely (px; 0 to
        1000; by level 2, 5, 6, 9, 12).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019), without its smoothing.
    Not part of the default set.
    """

def grayscale_filter(
    level: Level = 2.0,
    *,
    weight: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Blends the frame with its own grey.

    weight: share of the grey in the result (0 to 1; by level 0.1, 0.2, 0.35, 0.55, 0.85).
    Source: Luma of ITU-R BT.601.
    """

def high_pass_filter(
    level: Level = 2.0,
    *,
    kernel_size: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Subtracts a Gaussian blur from twice the frame: an unsharp mask, which emphasises edges.

    kernel_size: width of the blur's kernel, rounded to the nearest odd number (px; 1 to 301; by level 35, 59, 83,
        107, 113).
    Source: Unsharp mask; the blur's standard deviation is 0.3 * ((size - 1) / 2 - 1) + 0.8.
    Not part of the default set.
    """

def histogram_equalisation(
    level: Level = 2.0,
    *,
    clip_limit: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Equalises the histogram of the brightness in 8x8 tiles, under a limit of contrast.

    clip_limit: largest share of a value in a tile, as a multiple of its share in a flat histogram (0 to 256; by
        level 1, 3, 5, 7, 10).
    Source: Zuiderveld, Contrast limited adaptive histogram equalization (1994).
    """

def imagenet_c_brightness(
    level: Level = 2.0,
    *,
    added: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Adds to the brightness of every pixel, keeping its hue and saturation.

    added: what is added, of full scale (-1 to 1; by level 0.1, 0.2, 0.3, 0.4, 0.5).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    Not part of the default set.
    """

def imagenet_c_contrast(
    level: Level = 2.0,
    *,
    factor: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Draws the values of each channel together about their mean.

    factor: what is left of the contrast (0 to 10; by level 0.4, 0.3, 0.2, 0.1, 0.05).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    Not part of the default set.
    """

def imagenet_c_defocus_blur(
    level: Level = 2.0,
    *,
    radius: ByLevel | None = None,
    edge: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Averages every pixel over a disc with soft edges.

    radius: radius of the disc (px; 0 to 60; by level 3, 4, 6, 8, 10).
    edge: standard deviation of what softens its edge (px; 0.01 to 5; by level 0.1, 0.5, 0.5, 0.5, 0.5).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    Not part of the default set.
    """

def imagenet_c_elastic_transform(
    level: Level = 2.0,
    *,
    alpha: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Displaces every pixel at random, smoothly, in the same way in all frames of a sequence.

    alpha: what displacements are multiplied by (0 to 1000; by level 12.5, 16.25, 21.25, 25, 30).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    Not part of the default set.
    """

def imagenet_c_fog(
    level: Level = 2.0,
    *,
    thickness: ByLevel | None = None,
    decay: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Adds a fractal field of grey, the same one in all frames of a sequence.

    thickness: weight of the field (0 to 100; by level 1.5, 2, 2.5, 2.5, 3).
    decay: how much weaker the field is at each finer scale (1 to 10; by level 2, 2, 1.7, 1.5, 1.4).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    Not part of the default set.
    """

def imagenet_c_frost(
    level: Level = 2.0,
    *,
    weight: ByLevel | None = None,
    ice: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Adds a window of a texture of ice to the darkened frame, the same one in all frames of a sequence.

    weight: weight of the frame (0 to 1; by level 1, 0.8, 0.7, 0.65, 0.6).
    ice: weight of the ice (0 to 1; by level 0.4, 0.6, 0.7, 0.7, 0.75).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    Not part of the default set.
    """

def imagenet_c_gaussian_blur(
    level: Level = 2.0,
    *,
    sigma: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Smooths with a Gaussian kernel.

    sigma: standard deviation of the kernel (px; 0.1 to 50; by level 1, 2, 3, 4, 6).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    Not part of the default set.
    """

def imagenet_c_gaussian_noise(
    level: Level = 2.0,
    *,
    sigma: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Adds normally distributed noise to every value, anew in every frame.

    sigma: standard deviation of the noise (of full scale; 0 to 1; by level 0.08, 0.12, 0.18, 0.26, 0.38).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    Not part of the default set.
    """

def imagenet_c_glass_blur(
    level: Level = 2.0,
    *,
    sigma: ByLevel | None = None,
    distance: ByLevel | None = None,
    rounds: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Smooths, gives pixels the colours of random ones nearby, and smooths again.

    sigma: standard deviation of both Gaussians (px; 0.1 to 20; by level 0.7, 0.9, 1, 1.1, 1.5).
    distance: largest distance left and up; right and down one less (px; 1 to 100; by level 1, 2, 2, 3, 4).
    rounds: how often pixels are scattered (1 to 20; by level 2, 1, 3, 2, 2).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    Not part of the default set.
    """

def imagenet_c_impulse_noise(
    level: Level = 2.0,
    *,
    share: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Sets random values to 0 or 255, anew in every frame.

    share: share of the values that are hit (0 to 1; by level 0.03, 0.06, 0.09, 0.17, 0.27).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    Not part of the default set.
    """

def imagenet_c_jpeg_compression(
    level: Level = 2.0,
    *,
    quality: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Compresses the frame as JPEG and decompresses it again.

    quality: quality, 1 for the coarsest (1 to 100; by level 25, 18, 15, 10, 7).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    Not part of the default set.
    """

def imagenet_c_motion_blur(
    level: Level = 2.0,
    *,
    radius: ByLevel | None = None,
    sigma: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Blurs along a line at a random angle within 45 degrees of the horizontal.

    radius: half the number of copies (px; 0 to 200; by level 10, 15, 15, 15, 20).
    sigma: standard deviation of the weights along the line (px; 0.1 to 200; by level 3, 5, 8, 12, 15).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    Not part of the default set.
    """

def imagenet_c_pixelate(
    level: Level = 2.0,
    *,
    factor: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Shrinks the frame and enlarges it to blocks.

    factor: what width and height are shrunk by (0.01 to 1; by level 0.6, 0.5, 0.4, 0.3, 0.25).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    Not part of the default set.
    """

def imagenet_c_saturate(
    level: Level = 2.0,
    *,
    factor: ByLevel | None = None,
    added: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Makes colours paler or more vivid; what is added to the saturation of grey makes it red.

    factor: what saturation is multiplied by (0 to 100; by level 0.3, 0.1, 2, 5, 20).
    added: what is added then (-1 to 1; by level 0, 0, 0, 0.1, 0.2).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    Not part of the default set.
    """

def imagenet_c_shot_noise(
    level: Level = 2.0,
    *,
    k: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Replaces every value by a random photon count around it, anew in every frame.

    k: photons that a white pixel counts (1 to 500; by level 60, 25, 12, 5, 3).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    Not part of the default set.
    """

def imagenet_c_snow(
    level: Level = 2.0,
    *,
    mean: ByLevel | None = None,
    deviation: ByLevel | None = None,
    size: ByLevel | None = None,
    threshold: ByLevel | None = None,
    radius: ByLevel | None = None,
    sigma: ByLevel | None = None,
    weight: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lays streaks of snow over the frame and whitens it, anew in every frame.

    mean: mean of what flakes are drawn from (-5 to 5; by level 0.1, 0.2, 0.55, 0.55, 0.55).
    deviation: standard deviation of that (0 to 5; by level 0.3, 0.3, 0.3, 0.3, 0.3).
    size: how much flakes are enlarged (1 to 20; by level 3, 2, 4, 4.5, 2.5).
    threshold: values below it are not flakes (-5 to 5; by level 0.5, 0.5, 0.9, 0.85, 0.85).
    radius: half the length of a streak (px; 0 to 100; by level 10, 12, 12, 12, 12).
    sigma: how far streaks fade (px; 0.1 to 100; by level 4, 4, 8, 8, 12).
    weight: share of the frame as it was (0 to 1; by level 0.8, 0.7, 0.7, 0.65, 0.55).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    Not part of the default set.
    """

def imagenet_c_spatter(
    level: Level = 2.0,
    *,
    mean: ByLevel | None = None,
    deviation: ByLevel | None = None,
    size: ByLevel | None = None,
    threshold: ByLevel | None = None,
    strength: ByLevel | None = None,
    mud: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Drops of water (levels 0 to 2) or mud (3 and 4) on the lens, the same ones in all frames of a sequence.

    mean: mean of what drops are drawn from (-5 to 5; by level 0.65, 0.65, 0.65, 0.65, 0.67).
    deviation: standard deviation of that (0 to 5; by level 0.3, 0.3, 0.3, 0.3, 0.4).
    size: standard deviation of what smooths it (px; 0.1 to 50; by level 4, 3, 2, 1, 1).
    threshold: above it there is liquid (-5 to 5; by level 0.69, 0.68, 0.68, 0.65, 0.65).
    strength: brightness of water at its brightest; of mud, what smooths its edges, in pixels (0.1 to 50; by level
        0.6, 0.6, 0.5, 1.5, 1.5).
    mud: 1 for mud, 0 for water (0 to 1; by level 0, 0, 0, 1, 1).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    Not part of the default set.
    """

def imagenet_c_speckle_noise(
    level: Level = 2.0,
    *,
    sigma: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Multiplies every value by a normally distributed number around 1, anew in every frame.

    sigma: standard deviation of the factors (0 to 1; by level 0.15, 0.2, 0.35, 0.45, 0.6).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    Not part of the default set.
    """

def imagenet_c_zoom_blur(
    level: Level = 2.0,
    *,
    count: ByLevel | None = None,
    step: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Averages the frame with its enlargements about the middle.

    count: number of enlargements (0 to 200; by level 12, 16, 11, 13, 11).
    step: from one factor to the next (0 to 1; by level 0.01, 0.01, 0.02, 0.02, 0.03).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    Not part of the default set.
    """

def impulse_noise(
    level: Level = 2.0,
    *,
    fraction: ByLevel | None = None,
    variant: Literal["published", "corrected"] | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Sets random values to 255 and as many to 0, anew in every frame.

    fraction: share of the frame that is drawn, half of it for 255 and half for 0 (0 to 1; by level 0.01, 0.02,
        0.04, 0.065, 0.1).
    variant: published: single red and green values, never blue, the last row or the last column; corrected: whole
        pixels anywhere (default "published").
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    """

def increase_brightness(
    level: Level = 2.0,
    *,
    factor: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Multiplies the brightness of every pixel, keeping its hue and saturation.

    factor: factor of the brightness, which is clipped at 255; below 1 it darkens (0 to 10; by level 1.1, 1.2, 1.3,
        1.5, 1.7).
    Source: Smith, Color gamut transform pairs (1978), in 8 bits.
    """

def jpeg_filter(
    level: Level = 2.0,
    *,
    quality: ByLevel | None = None,
    variant: Literal["published", "corrected"] | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Compresses every frame as JPEG and decompresses it again.

    quality: quality, 1 for the coarsest (1 to 100; by level 30, 18, 15, 10, 5).
    variant: published: red and blue exchange their weights in the luma; corrected: they have the standard's
        (default "published").
    Source: ITU-T T.81 (1992), baseline with the tables of Annex K, chroma at half the resolution.
    """

def lagging_controls(
    level: Level = 2.0,
    *,
    steering: ByLevel | None = None,
    throttle: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lets steering and pedals follow the driver with a lag of first order.

    steering: time constant of the steering (s; 0 to 60; by level 0.05, 0.1, 0.2, 0.4, 0.8).
    throttle: time constant of throttle and brake (s; 0 to 60; default 0.0).
    Source: First-order lag of an actuator, as in Rajamani, Vehicle dynamics and control (2012).
    Not part of the default set.
    """

def late_controls(
    level: Level = 2.0,
    *,
    latency: Literal["constant", "jitter", "profile"] | None = None,
    delay: ByLevel | None = None,
    jitter: ByLevel | None = None,
    profile: str | PathLike[str] | None = None,
    factor: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Applies a control some time after the frame that it answers: always the same, with jitter, or as it was
    measured.

    latency: constant: always `delay`; jitter: `delay`, and as much again as is drawn for each control; profile:
        latencies of a file in their order (default "constant").
    delay: how late a control is, at most 240 frames; without effect with a profile (s; 0 to 4; by level 0.05, 0.1,
        0.2, 0.35, 0.5).
    jitter: mean of what jitter adds, which is distributed exponentially; only with `latency=jitter` (s; 0 to 4; by
        level 0.025, 0.05, 0.1, 0.175, 0.25).
    profile: a file with measured latencies in milliseconds, one a line; after the last one the first follows; only
        with `latency=profile`.
    factor: what measured latencies are multiplied by; only with `latency=profile` (0 to 1000; by level 0.25, 0.5,
        1, 2, 4).
    Source: Latency from frame to control as in Falanga, Kim and Scaramuzza, How fast is too fast? (2019), and its
        variation as in RFC 3393; delayed outputs are among the timing faults of AVFI: Jha et al., AVFI: Fault
        injection for autonomous vehicles (2018).
    Not part of the default set.
    """

def late_speed(
    level: Level = 2.0,
    *,
    delay: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Tells the driver the speed of some time ago.

    delay: how much later the driver gets a reading; at most 120 frames (s; 0 to 2; by level 0.1, 0.2, 0.4, 0.7, 1).
    Source: Delayed sensor data, one of the timing faults of AVFI: Jha et al., AVFI: Fault injection for autonomous
        vehicles (2018).
    Not part of the default set.
    """

def lens_flare(
    level: Level = 2.0,
    *,
    strength: ByLevel | None = None,
    source: Literal["drawn", "placed"] | None = None,
    x: float | None = None,
    y: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Puts a bright source, such as the sun or a lamp, in front of the camera, with the veil, the rays and the images
    of the aperture that it makes in the lens.

    strength: how bright the stray light is (0 to 100; by level 0.3, 0.7, 1.5, 3, 6).
    source: drawn: the source is somewhere in the upper part of the frame; placed: at `x` and `y` (default "drawn").
    x: place of the source as a share of the width; only with `source=placed` (-1 to 2; default 0.7).
    y: place of the source as a share of the height; only with `source=placed` (-1 to 2; default 0.12).
    Source: Veiling glare and ghosts as in ISO 18844:2017 and Hullin et al., Physically-based real-time lens flare
        rendering (2011).
    Not part of the default set.
    """

def limited_controls(
    level: Level = 2.0,
    *,
    steering: ByLevel | None = None,
    throttle: float | None = None,
    brake: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Limits how far the vehicle steers, and how much it accelerates and brakes.

    steering: most steering to either side, as a share of full lock (0 to 1; by level 0.3, 0.2, 0.15, 0.1, 0.06).
    throttle: most throttle (0 to 1; default 1.0).
    brake: most brake (0 to 1; default 1.0).
    Source: Saturation of an actuator, as in Rajamani, Vehicle dynamics and control (2012).
    Not part of the default set.
    """

def lost_blocks(
    level: Level = 2.0,
    *,
    lost: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Loses runs of 16 x 16 blocks and shows the latest that came in their place, as a decoder that conceals losses
    does.

    lost: share of the rows of blocks that lose blocks in a frame (0 to 1; by level 0.02, 0.06, 0.15, 0.35, 0.7).
    Source: A slice is lost from the first damaged macroblock to its end (ITU-T H.264, clause 7.3.4); concealed by
        copies of the frame before.
    Not part of the default set.
    """

def lost_controls(
    level: Level = 2.0,
    *,
    lost: ByLevel | None = None,
    burst: ByLevel | None = None,
    applies: Literal["last", "nothing"] | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Loses controls in bursts, while the vehicle keeps to the last one that came.

    lost: share of the controls that are lost; 1 of 41 arrives in any case (0 to 1; by level 0.1, 0.2, 0.35, 0.5,
        0.7).
    burst: how many controls are lost in a row, on average; no fewer than if each were lost by itself, and never
        more than 40 (frames; 1 to 40; by level 1, 2, 4, 8, 16).
    applies: what is applied in place of a lost control: last: the last one that came; nothing: wheels straight,
        neither throttle nor brake (default "last").
    Source: Burst losses as in Gilbert, Capacity of a burst-noise channel (1960); lost messages are among the timing
        faults of AVFI: Jha et al., AVFI: Fault injection for autonomous vehicles (2018).
    Not part of the default set.
    """

def lost_speed(
    level: Level = 2.0,
    *,
    lost: ByLevel | None = None,
    burst: ByLevel | None = None,
    shows: Literal["last", "zero", "unknown"] | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Loses readings of the speed in bursts, and tells the driver the last one meanwhile.

    lost: share of the readings that are lost; 1 of 41 arrives in any case (0 to 1; by level 0.1, 0.2, 0.35, 0.5,
        0.7).
    burst: how many readings are lost in a row, on average; no fewer than if each were lost by itself, and never
        more than 40 (frames; 1 to 40; by level 2, 4, 6, 10, 16).
    shows: what the driver gets in place of a lost reading: last: the last one that came; zero: a standing vehicle;
        unknown: that the speed is not known (default "last").
    Source: Burst losses as in Gilbert, Capacity of a burst-noise channel (1960); stuck values of sensors in ISO
        26262-5:2018, annex D.
    Not part of the default set.
    """

def low_pass_filter(
    level: Level = 2.0,
    *,
    kernel_size: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Smooths brightness with a Gaussian kernel, keeping hue and saturation.

    kernel_size: width of the kernel, rounded to the nearest odd number (px; 1 to 99; by level 15, 23, 31, 37, 41).
    Source: Gaussian filter on the value of hue, saturation and value, in 8 bits.
    """

def motion_blur(
    level: Level = 2.0,
    *,
    size: ByLevel | None = None,
    degrees: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Averages every pixel along a slanted line.

    size: height of the line, rounded to whole rows; an even one also shifts the frame by half a pixel, which
        between levels can outweigh the blur (px; 1 to 200; by level 2, 4, 6, 10, 15).
    degrees: direction of the line, from vertical, positive from top left to bottom right (degrees; -45 to 45; by
        level 5, 12, 20, 30, 45).
    Source: Average over one pixel in each row of a square kernel, along a line through its middle.
    """

def night(
    level: Level = 2.0,
    *,
    strength: ByLevel | None = None,
    fit: Literal["scale", "tile"] | None = None,
    overlap: float | None = None,
    engine: Literal["auto", "pdk", "onnxruntime"] | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Repaints a day as a night with headlights, by a network.

    strength: how much of the result is the network's (0 to 1; by level 0.2, 0.4, 0.6, 0.8, 1).
    fit: scale: the frame is brought to the size of the network's image and the result back; tile: the network sees
        the frame piece by piece at its own resolution, for frames that are not smaller than its image (default
        "scale").
    overlap: the share of a tile by which it reaches into the next; only with `fit=tile` (0 to 0.5; default 0.25).
    engine: who runs the network, which gives the same result on each engine: auto is onnxruntime if it is
        installed, else pdk (default "auto").
    Source: Johnson et al., Perceptual Losses for Real-Time Style Transfer and Super-Resolution, 2016.
    Not part of the default set.
    """

def night_by_illuminance(
    level: Level = 2.0,
    *,
    illuminance: ByLevel | None = None,
    beam: Literal["low", "high", "off"] | None = None,
    intensity: float | None = None,
    daylight: float | None = None,
    stops: float | None = None,
    longer: float | None = None,
    full_well: float | None = None,
    read: float | None = None,
    depth: Literal["ground", "simulator"] | None = None,
    field_of_view: float | None = None,
    camera_height: float | None = None,
    camera_pitch: float | None = None,
    beyond: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Takes the daylight away down to an illuminance, lights the road with headlights, and exposes as a camera does by
    night, longer and with more noise.

    illuminance: light that is left besides the headlights: 400 at sunset, 40 in a street with lamps, 3.4 when civil
        twilight ends, 0.27 under a full moon, 0.002 under stars (lx; 0 to 100000; by level 400, 40, 3.4, 0.27,
        0.002).
    beam: how the headlights are set (default "low").
    intensity: luminous intensity of the headlights where they are brightest (cd; 0 to 1e+06; default 25000.0).
    daylight: illuminance under which the frame was taken (lx; 1 to 200000; default 10000.0).
    stops: how much more the camera can expose and amplify than by day (stops; 0 to 24; default 9.0).
    longer: how much of that is a longer exposure, which costs no electrons (stops; 0 to 24; default 4.0).
    full_well: electrons of white by day (electrons; 10 to 1e+06; default 10000.0).
    read: noise of reading the sensor out (electrons; 0 to 1000; default 4.0).
    depth: where distances come from: ground: what is below the horizon lies on a plane, and all above it is
        `beyond` away; simulator: as the simulator knows them (default "ground").
    field_of_view: angle that the frame's width covers (degrees; 20 to 130; default 75.0).
    camera_height: height of the camera above the road (m; 0.1 to 10; default 1.35).
    camera_pitch: angle by which the camera looks down (degrees; -45 to 45; default 8.0).
    beyond: how far away everything above the horizon is, and the furthest that the ground is; only with
        `depth=ground` (m; 1 to 100000; default 150.0).
    Source: Illuminance by dusk and night as in Bond and Henderson, The conspicuity of emergency vehicle lighting
        (1963); beam after the test points of UNECE regulation 112; reflection of the road by EN 1436; noise by EMVA
        1288; light by IEC 61966-2-1 (sRGB).
    Not part of the default set.
    """

def noisy_speed(
    level: Level = 2.0,
    *,
    sigma: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Adds normally distributed noise to the speed that the driver gets.

    sigma: standard deviation of the noise (m/s; 0 to 100; by level 0.2, 0.5, 1, 2, 4).
    Source: White noise of a sensor; sensor noise is among the faults of AVFI: Jha et al., AVFI: Fault injection for
        autonomous vehicles (2018).
    Not part of the default set.
    """

def object_overlay(
    level: Level = 2.0,
    *,
    divisor: ByLevel | None = None,
    variant: Literal["published", "corrected"] | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lays the project's logo over the middle of the frame.

    divisor: c: the frame's height over the logo's size, which the variant says more of (0.5 to 10000; by level 10,
        5, 3, 2, 1.5).
    variant: published: the width is 1 / c of the frame's height, and the logo is too flat; corrected: its height
        is, in the right aspect, but no wider than the frame (default "published").
    Source: Leonhard, Lambertenghi and Stocco, PerturbationDrive: an opaque logo in the middle.
    """

def overlay(
    level: Level = 2.0,
    *,
    opacity: ByLevel | None = None,
    fit: Literal["cover", "stretch"] | None = None,
    loop: Literal["cross-fade", "ping-pong", "repeat"] | None = None,
    rate: float | None = None,
    clip: str | PathLike[str] | None = None,
    key: str | None = None,
    seconds: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lays a green-screen clip of the user's over the frame.

    opacity: how visible the clip is, in steps of 1/256; 1 as in the clip (0 to 1; by level 0.2, 0.4, 0.6, 0.8, 1).
    fit: cover: the clip keeps its shape, and what sticks out of the frame is cut off; stretch: it takes the shape
        of the frame, as published (default "cover").
    loop: cross-fade: the last half second fades into the first; ping-pong: the clip runs back to its beginning;
        repeat: it starts again (default "cross-fade").
    rate: frames of the clip per second of simulation time; 0: the clip's own, or, if the clip follows the vehicle's
        speed, what that makes of it (Hz; 0 to 1000; default 0.0).
    clip: video (its sound is not used), animated or still picture, or folder of pictures; before a screen of one
        colour, or with an alpha channel; or the name of a clip of pdk's own, such as built-in:birds.
    key: colour of the screen, such as #05c142; `auto` or nothing: found in the clip.
    seconds: how much of the clip is used at most (s; 0.01 to 3600; default 30.0).
    Source: Chroma keying by screen subtraction: Jack, Video Demystified.
    Not part of the default set.
    """

def partial_frames(
    level: Level = 2.0,
    *,
    partial: ByLevel | None = None,
    missing: ByLevel | None = None,
    fill: Literal["previous", "last_row", "black"] | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Loses the lower rows of some frames and fills them as a receiver does, with those of the frame before.

    partial: share of the frames that are not received in full (0 to 1; by level 0.1, 0.2, 0.4, 0.6, 0.9).
    missing: largest share of the rows that is lost (0 to 1; by level 0.3, 0.5, 0.7, 0.85, 1).
    fill: what lost rows show: previous: the rows of the frame before; last_row: the last row that was received;
        black: nothing (default "previous").
    Source: Transfer that ends early; the rows of the previous frame are what a frame buffer still holds.
    Not part of the default set.
    """

def pgd(
    level: Level = 2.0,
    *,
    epsilon: ByLevel | None = None,
    norm: Literal["linf", "l2"] | None = None,
    steps: int | None = None,
    step: float | None = None,
    random_start: bool | None = None,
    goal: Literal["away", "left", "right", "target"] | None = None,
    target: float | None = None,
    expectation: Literal["none", "changes"] | None = None,
    changes: int | None = None,
    shift: float | None = None,
    blur: float | None = None,
    brightness: float | None = None,
    noise: float | None = None,
    model: str | PathLike[str] | None = None,
    engine: Literal["pdk", "auto", "onnxruntime"] | None = None,
    preset: Literal["auto", "dave2", "udacity", "donkeycar_linear", "donkeycar_categorical", "donkeycar_memory", "donkeycar_rnn", "donkeycar_3d"] | None = None,
    crop: Any | None = None,
    image_size: Any | None = None,
    resize: Literal["auto", "bilinear", "nearest", "area", "bicubic", "pil_bilinear", "pil_bicubic", "linear"] | None = None,
    color: Literal["auto", "rgb", "bgr", "grey", "yuv", "hsv"] | None = None,
    scale: Any | None = None,
    mean: Any | None = None,
    std: Any | None = None,
    layout: Literal["auto", "nchw", "nhwc", "ntchw", "nthwc", "ncthw"] | None = None,
    dtype: Literal["auto", "float32", "float16", "uint8", "int8"] | None = None,
    frames: Any | None = None,
    spacing: Any | None = None,
    order: Literal["auto", "oldest_first", "newest_first"] | None = None,
    start: Literal["auto", "repeat", "zeros"] | None = None,
    differences: Literal["auto", "none", "only", "both"] | None = None,
    inputs: Any | None = None,
    state: Any | None = None,
    steering: Any | None = None,
    throttle: Any | None = None,
    waypoints: Any | None = None,
    speed: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Changes each pixel a little so that a network steers elsewhere, by several steps along the gradient of its
    steering.

    epsilon: the size of the change: with `norm=linf` no value changes by more than this, rounded down; with
        `norm=l2` the root of the mean square of all changes is at most this (grey levels of 255; 0 to 255; by level
        1, 2, 4, 8, 16).
    norm: how the size of the change is measured: linf by its largest value, l2 by the root of the mean square over
        all values (default "linf").
    steps: how many steps are taken; with `goal=away` as many to either side (1 to 1000; default 10).
    step: how long a step is, as a share of `epsilon` (0.001 to 2; default 0.25).
    random_start: whether the steps start at a change that is drawn for each frame, and not at the frame as it is
        (default true).
    goal: where the network is to steer: away from what it gives for the frame as it is, on whichever side that is
        further; left; right; or to `target` (default "away").
    target: the steering that the network is to give, from -1 for left to 1 for right; only with `goal=target` (-1
        to 1; default 0.0).
    expectation: over what the steering and its gradient are averaged: over nothing, so that the network sees the
        frame as it is, or over drawn changes of it, so that the attack survives such changes (default "none").
    changes: over how many drawn changes of a frame the mean is taken; only with `expectation=changes` (1 to 1000;
        default 8).
    shift: how far a drawn change moves the frame at most along each axis, rounded down; only with
        `expectation=changes` (pixels; 0 to 100; default 2.0).
    blur: the largest standard deviation of the Gaussian blur of a drawn change; only with `expectation=changes`
        (pixels; 0 to 20; default 1.0).
    brightness: by which share a drawn change makes all values greater or smaller at most; only with
        `expectation=changes` (0 to 1; default 0.2).
    noise: the standard deviation of the noise of a drawn change; only with `expectation=changes` (grey levels of
        255; 0 to 255; default 8.0).
    model: the ONNX file of the network that is attacked, or the name of a network that is part of pdk; it need not
        be the driver.
    engine: who runs the network: pdk computes the same on every processor; onnxruntime is ONNX Runtime, which has
        to be installed, knows more operators, and computes as the processor lets it; auto is onnxruntime if it is
        installed, else pdk. A scenario records the engine with its version, such as pdk 1 (default "pdk").
    preset: a description that has a name; fields beside it override its fields; auto: as the file beside the model
        says, or none (default "auto").
    crop: what is cut off at each side: whole numbers are pixels, numbers below 1 are shares ({ top = 60, bottom =
        25, left = 0, right = 0 }); left out: as the file beside the model says, or nothing.
    image_size: the size of the network's image, which a file may leave open ([width, height]); left out: as the
        file beside the model says, or as the file declares.
    resize: the filter: bilinear, area and bicubic are OpenCV's, nearest, pil_bilinear and pil_bicubic are PIL's and
        torchvision's, and linear is pdk's own; auto: as the file beside the model says, or bilinear (default
        "auto").
    color: what the channels are, by OpenCV's 8-bit conversions: yuv is COLOR_RGB2YUV, hsv is COLOR_RGB2HSV with hue
        from 0 to 179; auto: as the file beside the model says, or rgb, or grey for one channel (default "auto").
    scale: the range to which bytes are brought, or the factor on them ("0..255", "0..1", "-1..1", another range, or
        a factor); left out: as the file beside the model says, or 0..255.
    mean: what is subtracted after the scale (a number, or one for each channel); left out: as the file beside the
        model says, or 0.
    std: what is divided by after that (a number, or one for each channel); left out: as the file beside the model
        says, or 1.
    layout: the order of the image's axes: batch n, time t, channels c, height h, width w; frames of a stack are
        joined along t, or along c if there is no t; auto: as the file beside the model says, or by the shape
        (default "auto").
    dtype: the type of the image's numbers; bytes are rounded to the nearest; auto: as the file beside the model
        says, or as the file declares (default "auto").
    frames: how many frames the image stacks (a whole number); left out: as the file beside the model says, or 1, or
        the length of axis t.
    spacing: the distance between stacked frames, in frames (a whole number); left out: as the file beside the model
        says, or 1.
    order: the order of stacked frames; auto: as the file beside the model says, or oldest_first (default "auto").
    start: what stands for frames before the first of a sequence: the first, or zeros; auto: as the file beside the
        model says, or repeat (default "auto").
    differences: whether the stack holds the differences of neighbouring frames: only them (one fewer than frames),
        or the newest frame followed by them; auto: as the file beside the model says, or none (default "auto").
    inputs: what each input gets: the image; the speed, as { value = "speed", unit = "km/h", scale = 1, offset = 0,
        assumed = 8 }, where assumed is in m/s and stands for a speed that is not known; the controls before, as {
        value = "controls" }; or constants ({ NAME = "image", "speed", "controls", a number, a list or a table });
        left out: as the file beside the model says, or by name and shape.
    state: inputs that get what an output was at the frame before, and zeros at the first ({ INPUT = "OUTPUT" });
        left out: as the file beside the model says, or NAME_in and NAME_out.
    steering: the output that steers, or { output = "NAME", index = 0, bins = { from = -1, to = 1, count = 15 },
        decode = "argmax", scale = 1, offset = 0, clip = [-1, 1] }; bins may be a list of values; decode may also be
        mean, or softmax_mean for logits ("OUTPUT" or a table); left out: as the file beside the model says, or the
        first output.
    throttle: the output that gives the throttle, likewise; a number is a constant throttle ("OUTPUT", a table or a
        number); left out: as the file beside the model says, or the second output or number, or 0.3.
    waypoints: the output with the waypoints of a network that plans: what their numbers are, the seconds between
        them, and wheelbase in metres and full lock in degrees of the vehicle that follows them ({ output =
        "waypoints", axes = "forward_left", interval = 0.5, wheelbase = 2.6, full_lock = 25 }); left out: as the
        file beside the model says, or the network steers.
    speed: the speed that is given to a network with a speed input where the real one is not known, as for pictures
        (m/s; 0 to 100; default 8.0).
    Source: Madry et al., Towards Deep Learning Models Resistant to Adversarial Attacks, 2018; `expectation`:
        Athalye et al., Synthesizing Robust Adversarial Examples, 2018.
    Not part of the default set.
    """

def phase_scrambling(
    level: Level = 2.0,
    *,
    strength: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Adds random angles to the phases of each channel's Fourier transform, anew in every frame.

    strength: largest angle, as a share of half a turn; the frame darkens with it, because its mean has a phase too
        (0 to 1; by level 0.05, 0.15, 0.26, 0.38, 0.55).
    Source: Geirhos and others, Generalisation in humans and deep neural networks (2018): phase noise.
    """

def pixelate(
    level: Level = 2.0,
    *,
    factor: ByLevel | None = None,
    variant: Literal["published", "corrected"] | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Shrinks the frame and enlarges it again.

    factor: factor of width and height, which are rounded down to whole pixels (0.001 to 1; by level 0.85, 0.55,
        0.35, 0.2, 0.1).
    variant: published: linear interpolation both ways, which blurs and makes no blocks; corrected: means down,
        repeated pixels up (default "published").
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    """

def poisson_noise(
    level: Level = 2.0,
    *,
    k: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Replaces every value by a random photon count around it, anew in every frame.

    k: photons that a white pixel counts on average (photons; 1 to 500; by level 120, 105, 87, 55, 30).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    """

def posterize_filter(
    level: Level = 2.0,
    *,
    tones: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Reduces the number of tones of each channel.

    tones: number of tones; need not be whole, it divides the range of values (2 to 256; by level 128, 64, 32, 8,
        4).
    Source: Leonhard, Lambertenghi and Stocco, PerturbationDrive: uniform quantisation of each channel.
    """

def quantised_controls(
    level: Level = 2.0,
    *,
    step: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Rounds controls to steps, as coarse messages or switched actuators do.

    step: the distance between two values, all of which lie from -1 to 1 (0 to 2; by level 0.02, 0.05, 0.1, 0.2,
        0.4).
    Source: Uniform mid-tread quantisation, as in Widrow and Kollár, Quantization noise (2008).
    Not part of the default set.
    """

def rain_by_rate(
    level: Level = 2.0,
    *,
    rate: ByLevel | None = None,
    exposure: float | None = None,
    speed: float | None = None,
    sky: float | None = None,
    depth: Literal["ground", "simulator"] | None = None,
    field_of_view: float | None = None,
    camera_height: float | None = None,
    camera_pitch: float | None = None,
    beyond: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lets it rain at a rate: near drops are streaks in front of what is further away, and the others take contrast
    from the distance.

    rate: how much it rains: slight below 2.5, moderate to 10, heavy to 50, violent above (mm/h; 0 to 300; by level
        1, 4, 12, 35, 80).
    exposure: how long the camera exposes, in which what falls becomes a streak (s; 0.0001 to 0.1; default 0.012).
    speed: how fast the vehicle drives into it (m/s; 0 to 60; default 8.0).
    sky: grey of the sky that streaks and haze show: 0 is black, 255 white (0 to 255; default 215.0).
    depth: where distances come from: ground: what is below the horizon lies on a plane, and all above it is
        `beyond` away; simulator: as the simulator knows them (default "ground").
    field_of_view: angle that the frame's width covers (degrees; 20 to 130; default 75.0).
    camera_height: height of the camera above the road (m; 0.1 to 10; default 1.35).
    camera_pitch: angle by which the camera looks down (degrees; -45 to 45; default 8.0).
    beyond: how far away everything above the horizon is, and the furthest that the ground is; only with
        `depth=ground` (m; 1 to 100000; default 150.0).
    Source: Sizes by Marshall and Palmer, The distribution of raindrops with size (1948); fall by Atlas and Ulbrich
        (1977); streaks as in Garg and Nayar, Vision and rain (2007); haze by Koschmieder's law.
    Not part of the default set.
    """

def raindrops_on_lens(
    level: Level = 2.0,
    *,
    number: ByLevel | None = None,
    size: ByLevel | None = None,
    defocus: float | None = None,
    veil: float | None = None,
    speed: float | None = None,
    since: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Drops of water sit on the lens out of focus, refract the scene, veil it, join and run down.

    number: drops, small ones included, on a square of the lens as high as the frame (0 to 1008; by level 50, 110,
        220, 400, 640).
    size: radius of the largest drops (frame heights; 0 to 0.2; by level 0.026, 0.033, 0.041, 0.05, 0.06).
    defocus: radius of the disc that a point of a drop becomes, 128 pixels at most: drops are nearer than the focus
        (frame heights; 0 to 0.1; default 0.02).
    veil: how much of the scene's mean brightness the drops scatter over the frame where they cover it (0 to 1;
        default 0.35).
    speed: typical speed of drops that run down at level 2, the same one at all levels: what a higher level adds is
        faster, and what is there keeps its speed (frame heights per second; 0.001 to 2; default 0.23).
    since: how long it has been raining when the sequence starts (s; 0 to 60; default 60.0).
    Source: Particles with bounded lives; caps joined by a smooth maximum, refracted by their slope.
    """

def rainy(
    level: Level = 2.0,
    *,
    strength: ByLevel | None = None,
    fit: Literal["scale", "tile"] | None = None,
    overlap: float | None = None,
    engine: Literal["auto", "pdk", "onnxruntime"] | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Repaints a dry day as a rainy one, with thick air and a wet road, by a network.

    strength: how much of the result is the network's (0 to 1; by level 0.2, 0.4, 0.6, 0.8, 1).
    fit: scale: the frame is brought to the size of the network's image and the result back; tile: the network sees
        the frame piece by piece at its own resolution, for frames that are not smaller than its image (default
        "scale").
    overlap: the share of a tile by which it reaches into the next; only with `fit=tile` (0 to 0.5; default 0.25).
    engine: who runs the network, which gives the same result on each engine: auto is onnxruntime if it is
        installed, else pdk (default "auto").
    Source: Johnson et al., Perceptual Losses for Real-Time Style Transfer and Super-Resolution, 2016.
    Not part of the default set.
    """

def reflection_filter(
    level: Level = 2.0,
    *,
    share: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Stacks the bottom of the frame, upside down, under the frame and squeezes both to its height.

    share: share of the height that is reflected, rounded down to whole rows (0 to 1; by level 0.2, 0.3, 0.45, 0.6,
        0.9).
    Source: Linear interpolation without averaging.
    Not part of the default set.
    """

def reordered_frames(
    level: Level = 2.0,
    *,
    reordered: ByLevel | None = None,
    spread: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Shows frames out of order: each time one of the latest, drawn at random.

    reordered: share of the frames that are drawn (0 to 1; by level 0.2, 0.4, 0.6, 0.8, 1).
    spread: how far back a drawn frame lies at most (frames; 0 to 20; by level 1, 2, 4, 7, 12).
    Source: Packet reordering with a uniform displacement, as in RFC 4737.
    Not part of the default set.
    """

def repaint(
    level: Level = 2.0,
    *,
    model: str | PathLike[str] | None = None,
    engine: Literal["pdk", "auto", "onnxruntime"] | None = None,
    layout: Literal["auto", "nchw", "nhwc"] | None = None,
    scale: Literal["0..255", "0..1", "-1..1"] | None = None,
    color: Literal["rgb", "bgr"] | None = None,
    width: int | None = None,
    height: int | None = None,
    result: Literal["auto", "0..255", "0..1", "-1..1"] | None = None,
    strength: ByLevel | None = None,
    fit: Literal["scale", "tile"] | None = None,
    overlap: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Repaints the frame with a network that makes of an image another one.

    model: the ONNX file: an image of one or three channels in, and the result as its first output.
    engine: who runs the network: pdk computes the same on every processor; onnxruntime is ONNX Runtime, which has
        to be installed, knows more operators, and computes as the processor lets it; auto is onnxruntime if it is
        installed, else pdk. A scenario records the engine with its version, such as pdk 1 (default "pdk").
    layout: where the channels are: before or after height and width; auto reads it from the input's shape (default
        "auto").
    scale: the range of pixel values that the network was trained on (default "0..255").
    color: the order of colours that the network was trained on (default "rgb").
    width: width of the network's image if the file leaves it open (px; 1 to 4096; default 256).
    height: height of the network's image if the file leaves it open (px; 1 to 4096; default 256).
    result: the range of the numbers that the network gives; auto finds it out from a picture with all colours
        (default "auto").
    strength: how much of the result is the network's (0 to 1; by level 0.2, 0.4, 0.6, 0.8, 1).
    fit: scale: the frame is brought to the size of the network's image and the result back; tile: the network sees
        the frame piece by piece at its own resolution, for frames that are not smaller than its image (default
        "scale").
    overlap: the share of a tile by which it reaches into the next; only with `fit=tile` (0 to 0.5; default 0.25).
    Source: Any image-to-image network, such as those of Zhu et al., CycleGAN, 2017, and Johnson et al., Perceptual
        Losses, 2016.
    Not part of the default set.
    """

def rolling_shutter(
    level: Level = 2.0,
    *,
    readout: ByLevel | None = None,
    vibration: ByLevel | None = None,
    frequency: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Reads the rows of a frame one after the other, so that a turn shears the picture, and the vibration of the mount
    makes it wobble.

    readout: how long it takes to read all rows (s; 0 to 1; by level 0.01, 0.02, 0.03, 0.04, 0.05).
    vibration: how far the mount vibrates to either side, as a share of the width (0 to 0.2; by level 0.001, 0.002,
        0.005, 0.01, 0.02).
    frequency: how often the mount vibrates (Hz; 0 to 1000; default 35.0).
    Source: Liang, Chang and Chen, Analysis and compensation of rolling shutter effect (2008).
    Not part of the default set.
    """

def rotate_image(
    level: Level = 2.0,
    *,
    degrees: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Rotates the frame counter-clockwise over black; half a turn (level 4) can be closer to the original than a
    quarter.

    degrees: angle, counter-clockwise; negative turns clockwise (degrees; -360 to 360; by level 10, 20, 45, 90,
        180).
    Source: Rotation about half the width and height with linear interpolation at 1/32 px.
    Not part of the default set.
    """

def sample_pairing_filter(
    level: Level = 2.0,
    *,
    weight: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Blends the frame with an enlarged window of half its size; the window's place is drawn once per sequence.

    weight: share of the original in the result (0 to 1; by level 0.9, 0.7, 0.5, 0.3, 0.1).
    Source: Inoue, Data augmentation by pairing samples for images classification (2018), with a part of the same
        frame.
    """

def saturation_decrease_filter(
    level: Level = 2.0,
    *,
    factor: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Makes colours paler, keeping their hue and brightness.

    factor: factor of the saturation (0 to 1; by level 0.9, 0.85, 0.6, 0.35, 0.1).
    Source: Smith, Color gamut transform pairs (1978), in 8 bits.
    """

def saturation_filter(
    level: Level = 2.0,
    *,
    factor: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Makes colours more vivid, keeping their hue and brightness.

    factor: factor of the saturation, which is clipped at 255 (0 to 10; by level 1.05, 1.15, 1.4, 1.65, 1.9).
    Source: Smith, Color gamut transform pairs (1978), in 8 bits.
    """

def scale_image(
    level: Level = 2.0,
    *,
    factor: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Shrinks the frame and puts it in the middle of black.

    factor: factor of width and height, which are rounded down to whole pixels (0.01 to 1; by level 0.96, 0.9, 0.8,
        0.68, 0.5).
    Source: Linear interpolation without averaging.
    """

def sensor_noise(
    level: Level = 2.0,
    *,
    illuminance: ByLevel | None = None,
    aperture: float | None = None,
    exposure: float | None = None,
    pitch: float | None = None,
    efficiency: float | None = None,
    read: float | None = None,
    full_well: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Takes the frame with a camera in little light, whose sensor counts few electrons, and amplifies it to the
    brightness that it had.

    illuminance: light on the scene: 300 in a lit tunnel, 50 in a lit street, 2 at the end of civil twilight (lx;
        0.001 to 200000; by level 300, 50, 10, 2, 0.5).
    aperture: the f-number: focal length by diameter (0.5 to 64; default 2.0).
    exposure: how long the camera exposes (s; 1e-05 to 1; default 0.01).
    pitch: the side of a pixel of the sensor (um; 0.5 to 30; default 3.0).
    efficiency: electrons for each photon (0.01 to 1; default 0.6).
    read: noise of reading the sensor out (electrons; 0 to 1000; default 2.5).
    full_well: electrons that a pixel holds (electrons; 10 to 1e+06; default 10000.0).
    Source: EMVA 1288; illuminance behind a lens E / (4 N^2); 1.1e4 photons of daylight in a lux second and a square
        micrometre; light by IEC 61966-2-1 (sRGB).
    Not part of the default set.
    """

def sharpen_filter(
    level: Level = 2.0,
    *,
    gain: ByLevel | None = None,
    weight: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Blends the frame with a sharpened and brightened copy.

    gain: sum of the kernel: how much brighter the sharpened copy is than the frame; what it clips loses structure
        in steps (0 to 100; by level 1, 2, 3, 4, 5).
    weight: share of the original in the result (0 to 1; by level 0.9, 0.8, 0.7, 0.6, 0.5).
    Source: Laplacian with eight neighbours; its centre is larger by the gain, so it brightens too.
    """

def shear_image(
    level: Level = 2.0,
    *,
    factor: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Moves rows to the right, the lower the further, over black.

    factor: shift to the right for each pixel of height; negative shears to the left (px/px; -10 to 10; by level
        0.12, 0.2, 0.32, 0.45, 0.6).
    Source: Affine map x' = x + factor * y with linear interpolation at 1/32 px.
    Not part of the default set.
    """

def slow_controls(
    level: Level = 2.0,
    *,
    steering: ByLevel | None = None,
    throttle: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Limits how fast the steering and the pedals move.

    steering: how far the steering moves in a second, as a share of the way from the middle to full lock (1/s; 0 to
        1000; by level 1, 0.5, 0.25, 0.12, 0.06).
    throttle: how far throttle and brake move in a second, likewise (1/s; 0 to 1000; default 1000.0).
    Source: Rate limit of an actuator, as in Rajamani, Vehicle dynamics and control (2012).
    Not part of the default set.
    """

def snow_by_rate(
    level: Level = 2.0,
    *,
    rate: ByLevel | None = None,
    exposure: float | None = None,
    speed: float | None = None,
    sky: float | None = None,
    depth: Literal["ground", "simulator"] | None = None,
    field_of_view: float | None = None,
    camera_height: float | None = None,
    camera_pitch: float | None = None,
    beyond: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lets it snow at a rate: near flakes are streaks in front of what is further away, and the others hide the
    distance.

    rate: how much it snows, as water: light below 1, moderate to 2.5, heavy above (mm/h; 0 to 30; by level 0.1,
        0.3, 1, 2.5, 6).
    exposure: how long the camera exposes, in which what falls becomes a streak (s; 0.0001 to 0.1; default 0.012).
    speed: how fast the vehicle drives into it (m/s; 0 to 60; default 8.0).
    sky: grey of the sky that streaks and haze show: 0 is black, 255 white (0 to 255; default 215.0).
    depth: where distances come from: ground: what is below the horizon lies on a plane, and all above it is
        `beyond` away; simulator: as the simulator knows them (default "ground").
    field_of_view: angle that the frame's width covers (degrees; 20 to 130; default 75.0).
    camera_height: height of the camera above the road (m; 0.1 to 10; default 1.35).
    camera_pitch: angle by which the camera looks down (degrees; -45 to 45; default 8.0).
    beyond: how far away everything above the horizon is, and the furthest that the ground is; only with
        `depth=ground` (m; 1 to 100000; default 150.0).
    Source: Sizes by Sekhon and Srivastava, Snow size spectra and radar reflectivity (1970); density by Brandes et
        al., A statistical and physical description of hydrometeor distributions in Colorado snowstorms (2007); fall
        by Locatelli and Hobbs (1974); haze by Koschmieder's law.
    Not part of the default set.
    """

def snow_filter(
    level: Level = 2.0,
    *,
    opacity: ByLevel | None = None,
    variant: Literal["published", "corrected"] | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lays a texture of falling snow over the frame, the same one always, and lowers saturation.

    opacity: opacity of the texture where it covers what is behind it (0 to 1; by level 0.15, 0.22, 0.3, 0.45, 0.6).
    variant: published: the texture is opaque, so the whole frame is blended with it; corrected: it covers as much
        as there is of it (default "published").
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019), with a drawn texture.
    """

def snow_on_lens(
    level: Level = 2.0,
    *,
    number: ByLevel | None = None,
    size: ByLevel | None = None,
    defocus: float | None = None,
    veil: float | None = None,
    speed: float | None = None,
    since: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Flakes of snow land on the lens out of focus, veil the scene, creep down, pile up at the lower edge and melt.

    number: flakes on a square of the lens as high as the frame (0 to 270; by level 16, 36, 64, 100, 145).
    size: radius of the largest flakes (frame heights; 0 to 0.2; by level 0.03, 0.036, 0.043, 0.051, 0.06).
    defocus: radius of the disc that a point of a flake becomes, 128 pixels at most: flakes are nearer than the
        focus (frame heights; 0 to 0.1; default 0.02).
    veil: how much of the scene's mean brightness the flakes scatter over the frame where they cover it (0 to 1;
        default 0.2).
    speed: typical speed of flakes that came loose at level 2, the same one at all levels: what a higher level adds
        is faster, and what is there keeps its speed (frame heights per second; 0.001 to 2; default 0.04).
    since: how long it has been snowing when the sequence starts (s; 0 to 60; default 60.0).
    Source: Particles with bounded lives; stamps of clumps over water refracted by its slope.
    """

def speckle_noise_filter(
    level: Level = 2.0,
    *,
    sigma: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Multiplies every value by a normally distributed number around 1, anew in every frame.

    sigma: standard deviation of the multiplier (0 to 1; by level 0.02, 0.05, 0.09, 0.14, 0.2).
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    """

def splatter_mapping(
    level: Level = 2.0,
    *,
    discs: ByLevel | None = None,
    largest_radius: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lays black discs over the frame, at places that stay for a sequence.

    discs: number of discs, rounded to the nearest whole number (0 to 10000; by level 5, 10, 15, 20, 25).
    largest_radius: largest radius; each disc has a whole number from 5 to this one (px; 5 to 10000; by level 5, 9,
        14, 19, 24).
    Source: Leonhard, Lambertenghi and Stocco, PerturbationDrive: discs at random places.
    """

def square_attack(
    level: Level = 2.0,
    *,
    epsilon: ByLevel | None = None,
    queries: int | None = None,
    share: float | None = None,
    goal: Literal["away", "left", "right", "target"] | None = None,
    target: float | None = None,
    model: str | PathLike[str] | None = None,
    engine: Literal["pdk", "auto", "onnxruntime"] | None = None,
    preset: Literal["auto", "dave2", "udacity", "donkeycar_linear", "donkeycar_categorical", "donkeycar_memory", "donkeycar_rnn", "donkeycar_3d"] | None = None,
    crop: Any | None = None,
    image_size: Any | None = None,
    resize: Literal["auto", "bilinear", "nearest", "area", "bicubic", "pil_bilinear", "pil_bicubic", "linear"] | None = None,
    color: Literal["auto", "rgb", "bgr", "grey", "yuv", "hsv"] | None = None,
    scale: Any | None = None,
    mean: Any | None = None,
    std: Any | None = None,
    layout: Literal["auto", "nchw", "nhwc", "ntchw", "nthwc", "ncthw"] | None = None,
    dtype: Literal["auto", "float32", "float16", "uint8", "int8"] | None = None,
    frames: Any | None = None,
    spacing: Any | None = None,
    order: Literal["auto", "oldest_first", "newest_first"] | None = None,
    start: Literal["auto", "repeat", "zeros"] | None = None,
    differences: Literal["auto", "none", "only", "both"] | None = None,
    inputs: Any | None = None,
    state: Any | None = None,
    steering: Any | None = None,
    throttle: Any | None = None,
    waypoints: Any | None = None,
    speed: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Changes the colours of squares a little so that a network steers elsewhere, by random search that needs no
    gradient.

    epsilon: no value changes by more than this, rounded down (grey levels of 255; 0 to 255; by level 1, 2, 4, 8,
        16).
    queries: how often the network is asked about a changed frame, besides once for the frame as it is (1 to 100000;
        default 100).
    share: the share of the frame that the first squares cover; they shrink as queries are used up (0.0001 to 1;
        default 0.1).
    goal: where the network is to steer: away from what it gives for the frame as it is, on whichever side that is
        further; left; right; or to `target` (default "away").
    target: the steering that the network is to give, from -1 for left to 1 for right; only with `goal=target` (-1
        to 1; default 0.0).
    model: the ONNX file of the network that is attacked, or the name of a network that is part of pdk; it need not
        be the driver.
    engine: who runs the network: pdk computes the same on every processor; onnxruntime is ONNX Runtime, which has
        to be installed, knows more operators, and computes as the processor lets it; auto is onnxruntime if it is
        installed, else pdk. A scenario records the engine with its version, such as pdk 1 (default "pdk").
    preset: a description that has a name; fields beside it override its fields; auto: as the file beside the model
        says, or none (default "auto").
    crop: what is cut off at each side: whole numbers are pixels, numbers below 1 are shares ({ top = 60, bottom =
        25, left = 0, right = 0 }); left out: as the file beside the model says, or nothing.
    image_size: the size of the network's image, which a file may leave open ([width, height]); left out: as the
        file beside the model says, or as the file declares.
    resize: the filter: bilinear, area and bicubic are OpenCV's, nearest, pil_bilinear and pil_bicubic are PIL's and
        torchvision's, and linear is pdk's own; auto: as the file beside the model says, or bilinear (default
        "auto").
    color: what the channels are, by OpenCV's 8-bit conversions: yuv is COLOR_RGB2YUV, hsv is COLOR_RGB2HSV with hue
        from 0 to 179; auto: as the file beside the model says, or rgb, or grey for one channel (default "auto").
    scale: the range to which bytes are brought, or the factor on them ("0..255", "0..1", "-1..1", another range, or
        a factor); left out: as the file beside the model says, or 0..255.
    mean: what is subtracted after the scale (a number, or one for each channel); left out: as the file beside the
        model says, or 0.
    std: what is divided by after that (a number, or one for each channel); left out: as the file beside the model
        says, or 1.
    layout: the order of the image's axes: batch n, time t, channels c, height h, width w; frames of a stack are
        joined along t, or along c if there is no t; auto: as the file beside the model says, or by the shape
        (default "auto").
    dtype: the type of the image's numbers; bytes are rounded to the nearest; auto: as the file beside the model
        says, or as the file declares (default "auto").
    frames: how many frames the image stacks (a whole number); left out: as the file beside the model says, or 1, or
        the length of axis t.
    spacing: the distance between stacked frames, in frames (a whole number); left out: as the file beside the model
        says, or 1.
    order: the order of stacked frames; auto: as the file beside the model says, or oldest_first (default "auto").
    start: what stands for frames before the first of a sequence: the first, or zeros; auto: as the file beside the
        model says, or repeat (default "auto").
    differences: whether the stack holds the differences of neighbouring frames: only them (one fewer than frames),
        or the newest frame followed by them; auto: as the file beside the model says, or none (default "auto").
    inputs: what each input gets: the image; the speed, as { value = "speed", unit = "km/h", scale = 1, offset = 0,
        assumed = 8 }, where assumed is in m/s and stands for a speed that is not known; the controls before, as {
        value = "controls" }; or constants ({ NAME = "image", "speed", "controls", a number, a list or a table });
        left out: as the file beside the model says, or by name and shape.
    state: inputs that get what an output was at the frame before, and zeros at the first ({ INPUT = "OUTPUT" });
        left out: as the file beside the model says, or NAME_in and NAME_out.
    steering: the output that steers, or { output = "NAME", index = 0, bins = { from = -1, to = 1, count = 15 },
        decode = "argmax", scale = 1, offset = 0, clip = [-1, 1] }; bins may be a list of values; decode may also be
        mean, or softmax_mean for logits ("OUTPUT" or a table); left out: as the file beside the model says, or the
        first output.
    throttle: the output that gives the throttle, likewise; a number is a constant throttle ("OUTPUT", a table or a
        number); left out: as the file beside the model says, or the second output or number, or 0.3.
    waypoints: the output with the waypoints of a network that plans: what their numbers are, the seconds between
        them, and wheelbase in metres and full lock in degrees of the vehicle that follows them ({ output =
        "waypoints", axes = "forward_left", interval = 0.5, wheelbase = 2.6, full_lock = 25 }); left out: as the
        file beside the model says, or the network steers.
    speed: the speed that is given to a network with a speed input where the real one is not known, as for pictures
        (m/s; 0 to 100; default 8.0).
    Source: Andriushchenko et al., Square Attack: a query-efficient black-box adversarial attack via random search,
        2020.
    Not part of the default set.
    """

def static_lightning_filter(
    level: Level = 2.0,
    *,
    opacity: ByLevel | None = None,
    fit: Literal["cover", "stretch"] | None = None,
    horizon: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lays bolts of lightning over the frame, standing still.

    opacity: how visible the clip is, in steps of 1/256; 1 as in the clip (0 to 1; by level 0.2, 0.4, 0.6, 0.8, 1).
    fit: cover: the clip keeps its shape, and what sticks out of the frame is cut off; stretch: it takes the shape
        of the frame, as published (default "cover").
    horizon: where the horizon is in the frame, as a share of its height from the top: the clip is laid so that its
        own lies there, and enlarged as far as that takes; not with fit=stretch (0 to 1; default 0.32).
    Source: A loop over a green screen, drawn by this project.
    """

def static_object_overlay(
    level: Level = 2.0,
    *,
    opacity: ByLevel | None = None,
    fit: Literal["cover", "stretch"] | None = None,
    horizon: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lays birds in flight above the horizon over the frame, standing still.

    opacity: how visible the clip is, in steps of 1/256; 1 as in the clip (0 to 1; by level 0.2, 0.4, 0.6, 0.8, 1).
    fit: cover: the clip keeps its shape, and what sticks out of the frame is cut off; stretch: it takes the shape
        of the frame, as published (default "cover").
    horizon: where the horizon is in the frame, as a share of its height from the top: the clip is laid so that its
        own lies there, and enlarged as far as that takes; not with fit=stretch (0 to 1; default 0.32).
    Source: A loop over a green screen, drawn by this project.
    """

def static_rain_filter(
    level: Level = 2.0,
    *,
    opacity: ByLevel | None = None,
    fit: Literal["cover", "stretch"] | None = None,
    horizon: float | None = None,
    haze: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lays streaks of rain over the frame, standing still.

    opacity: how visible the clip is, in steps of 1/256; 1 as in the clip (0 to 1; by level 0.2, 0.4, 0.6, 0.8, 1).
    fit: cover: the clip keeps its shape, and what sticks out of the frame is cut off; stretch: it takes the shape
        of the frame, as published (default "cover").
    horizon: where the horizon is in the frame, as a share of its height from the top: the clip is laid so that its
        own lies there, and enlarged as far as that takes; not with fit=stretch (0 to 1; default 0.32).
    haze: the share of the distant scene that the air hides, at an opacity of 1 (0 to 1; default 0.45).
    Source: A loop over a green screen, drawn by this project.
    """

def static_smoke_filter(
    level: Level = 2.0,
    *,
    opacity: ByLevel | None = None,
    fit: Literal["cover", "stretch"] | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lays swathes of smoke over the frame, standing still.

    opacity: how visible the clip is, in steps of 1/256; 1 as in the clip (0 to 1; by level 0.2, 0.4, 0.6, 0.8, 1).
    fit: cover: the clip keeps its shape, and what sticks out of the frame is cut off; stretch: it takes the shape
        of the frame, as published (default "cover").
    Source: A loop over a green screen, drawn by this project.
    Not part of the default set.
    """

def static_snow_filter(
    level: Level = 2.0,
    *,
    opacity: ByLevel | None = None,
    fit: Literal["cover", "stretch"] | None = None,
    horizon: float | None = None,
    haze: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lays flakes of snow over the frame, standing still.

    opacity: how visible the clip is, in steps of 1/256; 1 as in the clip (0 to 1; by level 0.2, 0.4, 0.6, 0.8, 1).
    fit: cover: the clip keeps its shape, and what sticks out of the frame is cut off; stretch: it takes the shape
        of the frame, as published (default "cover").
    horizon: where the horizon is in the frame, as a share of its height from the top: the clip is laid so that its
        own lies there, and enlarged as far as that takes; not with fit=stretch (0 to 1; default 0.32).
    haze: the share of the distant scene that the air hides, at an opacity of 1 (0 to 1; default 0.5).
    Source: A loop over a green screen, drawn by this project.
    """

def static_sun_filter(
    level: Level = 2.0,
    *,
    opacity: ByLevel | None = None,
    fit: Literal["cover", "stretch"] | None = None,
    horizon: float | None = None,
    darker: float | None = None,
    veil: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lays glare of a low sun over the frame, standing still; the sun turns with the vehicle in a bend, because a
    perturbation does not know the vehicle's heading.

    opacity: how visible the clip is, in steps of 1/256; 1 as in the clip (0 to 1; by level 0.2, 0.4, 0.6, 0.8, 1).
    fit: cover: the clip keeps its shape, and what sticks out of the frame is cut off; stretch: it takes the shape
        of the frame, as published (default "cover").
    horizon: where the horizon is in the frame, as a share of its height from the top: the clip is laid so that its
        own lies there, and enlarged as far as that takes; not with fit=stretch (0 to 1; default 0.32).
    darker: the share of the light that the camera takes away, at an opacity of 1 (0 to 1; default 0.35).
    veil: the light scattered over the frame as a share of white, at an opacity of 1 (0 to 1; default 0.09).
    Source: A loop over a green screen, drawn by this project.
    """

def steering_offset(
    level: Level = 2.0,
    *,
    offset: ByLevel | None = None,
    side: Literal["drawn", "left", "right"] | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Shifts the steering to one side, as a wrong zero of its sensor does.

    offset: how far, as a share of full lock (0 to 1; by level 0.02, 0.05, 0.1, 0.15, 0.25).
    side: to which side (default "drawn").
    Source: Offset errors of sensors in ISO 26262-5:2018, annex D.
    Not part of the default set.
    """

def steering_play(
    level: Level = 2.0,
    *,
    play: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Gives the steering play, so that the wheels follow only when it is used up.

    play: how far the steering turns before the wheels follow, as a share of full lock (0 to 2; by level 0.02, 0.05,
        0.1, 0.2, 0.4).
    Source: Backlash as in Nordin and Gutman, Controlling mechanical systems with backlash: a survey (2002).
    Not part of the default set.
    """

def stuck_white_balance(
    level: Level = 2.0,
    *,
    stuck: ByLevel | None = None,
    scene: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Balances colours for the light of lamps by day, as a camera does whose white balance is stuck.

    stuck: the light for which colours are balanced: below that of the scene, the picture turns blue; above, it
        turns orange (K; 1667 to 25000; by level 5400, 4500, 3700, 3000, 2300).
    scene: the light of the scene (K; 1667 to 25000; default 6500.0).
    Source: Colour of black bodies by Kim et al., Design of advanced color temperature control system for HDTV
        applications (2002); gains as von Kries has them, in light by IEC 61966-2-1 (sRGB).
    Not part of the default set.
    """

def translate_image(
    level: Level = 2.0,
    *,
    shift: ByLevel | None = None,
    share: ByLevel | None = None,
    variant: Literal["published", "corrected"] | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Shifts the frame to the right and up, over black.

    shift: shift to the right, and as far up; negative goes left and down; only with `variant=published` (px; -10000
        to 10000; by level -0.1, 25, 40, 65, 90).
    share: shift to the right as a share of the width, and up as a share of the height; only with
        `variant=corrected` (-1 to 1; by level 0.04, 0.08, 0.125, 0.2, 0.28).
    variant: published: shift in pixels, a tenth of a pixel in the other direction at level 0; corrected: shares of
        the frame's size (default "published").
    Source: Shift with linear interpolation at 1/32 px.
    """

def universal_perturbation(
    level: Level = 2.0,
    *,
    picture: str | PathLike[str] | None = None,
    epsilon: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Adds the same small change to every frame, such as one that was trained so that a network steers elsewhere at
    all of them.

    picture: the change as a picture, as `pdk attack universal` writes one, in which 128 stands for none; or
        `dave2_universal`, which is part of pdk.
    epsilon: no value changes by more than this, rounded down (grey levels of 255; 0 to 255; by level 1, 2, 4, 8,
        16).
    Source: Moosavi-Dezfooli et al., Universal Adversarial Perturbations, 2017.
    Not part of the default set.
    """

def water_film(
    level: Level = 2.0,
    *,
    bend: ByLevel | None = None,
    flow: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Lets a film of water run down the glass in front of the camera, whose waves bend what is seen.

    bend: how far the steepest waves bend the light, in heights of the frame (0 to 0.2; by level 0.004, 0.008,
        0.016, 0.03, 0.05).
    flow: how fast the film runs down, in heights of the frame a second (1/s; 0 to 10; default 0.25).
    Source: Refraction by a thin film, of first order in its slope, as in Halimeh and Roser, Raindrop detection on
        car windshields using geometric-photometric environment construction (2009).
    Not part of the default set.
    """

def wet_road(
    level: Level = 2.0,
    *,
    film: ByLevel | None = None,
    puddles: ByLevel | None = None,
    beside: float | None = None,
    texture: float | None = None,
    speed: float | None = None,
    depth: Literal["ground", "simulator"] | None = None,
    field_of_view: float | None = None,
    camera_height: float | None = None,
    camera_pitch: float | None = None,
    beyond: float | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Puts a film of water on the ground, which is darker then and mirrors what is above the horizon, with puddles if
    there is much of it.

    film: how thick the water is: a damp road up to one under heavy rain (mm; 0 to 100; by level 0.05, 0.15, 0.4,
        0.8, 1.5).
    puddles: share of the ground that lies under puddles (0 to 1; by level 0, 0, 0.02, 0.07, 0.2).
    beside: how far the road reaches to either side of the camera; what lies further away stays dry (m; 0 to 1000;
        default 5.0).
    texture: how deep the texture of the road is, which stands out of thin films (mm; 0.01 to 10; default 0.8).
    speed: how fast the vehicle drives if it is not known how far it has driven (m/s; 0 to 60; default 8.0).
    depth: where distances come from: ground: what is below the horizon lies on a plane, and all above it is
        `beyond` away; simulator: as the simulator knows them (default "ground").
    field_of_view: angle that the frame's width covers (degrees; 20 to 130; default 75.0).
    camera_height: height of the camera above the road (m; 0.1 to 10; default 1.35).
    camera_pitch: angle by which the camera looks down (degrees; -45 to 45; default 8.0).
    beyond: how far away everything above the horizon is, and the furthest that the ground is; only with
        `depth=ground` (m; 1 to 100000; default 150.0).
    Source: Darkening by Lekner and Dorf, Why some things are darker when wet (1988); reflection by Fresnel's
        equations; thickness of films and depth of texture as in Gallaway et al., Tentative pavement and geometric
        design criteria for minimizing hydroplaning (1975).
    Not part of the default set.
    """

def white_balance_filter(
    level: Level = 2.0,
    *,
    weight: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Blends the frame with a version whose channels have equal means.

    weight: share of the correction in the result (0 to 1; by level 0.1, 0.25, 0.5, 0.75, 0.99).
    Source: Buchsbaum, A spatial processor model for object colour perception (1980): the grey-world assumption.
    """

def zigzag_mapping(
    level: Level = 2.0,
    *,
    lines: ByLevel | None = None,
    amplitude: ByLevel | None = None,
    frequency: ByLevel | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Draws lines of black pixels that swing up and down, at places that stay for a sequence; level 4 changes fewer
    pixels than level 3, as published.

    lines: number of lines, rounded to the nearest whole number (0 to 10000; by level 1, 2, 3, 4, 6).
    amplitude: largest swing of a step (px; 0 to 1000; by level 2, 4, 6, 8, 12).
    frequency: how far the swing's phase moves in a step (rad; 0 to 100; by level 1, 2, 3, 4, 6).
    Source: Leonhard, Lambertenghi and Stocco, PerturbationDrive: random lines with a sine added at every step.
    """

def zoom_blur(
    level: Level = 2.0,
    *,
    count: ByLevel | None = None,
    step: ByLevel | None = None,
    variant: Literal["published", "corrected"] | None = None,
    probability: float | None = None,
    region: Mapping[str, Any] | Sequence[float] | None = None,
    during: Mapping[str, Any] | None = None,
    where: Mapping[str, Any] | None = None,
    attention: str | Mapping[str, Any] | None = None,
    level_scale: str | Mapping[str, Any] | None = None,
    draws: Literal["per_frame", "per_sequence"] | None = None,
) -> Applied:
    """Averages the frame with its enlargements about the middle.

    count: number of enlargements, the first of which is none; a fraction is the weight of the last (0 to 1000; by
        level 2, 12, 8, 11, 11).
    step: difference between the factors of one enlargement and the next (0 to 10; by level 0.01, 0.01, 0.02, 0.02,
        0.03).
    variant: published: enlargements of whole pixels, up to a pixel off the middle, whose last row or column may be
        black; corrected: exactly about the middle (default "published").
    Source: Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations
        (2019).
    Not part of the default set.
    """
