"""Writes small recordings with other programs, and what has to be read from them: `python3 elsewhere.py FOLDER`.

A part whose program is not installed is left out. `expected.json` lists the others: the reader, its parameters, and for each frame its
time, steering, throttle and speed. The colours of a frame follow from its number, see `picture`.
"""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
from PIL import Image

WIDTH, HEIGHT, FRAMES = 32, 16, 6
EXPECTED = {}
LEFT_OUT = {}


def picture(number):
    """Red grows to the right, green downwards, and blue from frame to frame."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    return np.stack([x * 8, y * 16, np.full_like(x, number * 40)], axis=-1).astype(np.uint8)


def steering(number):
    return round(number / 10 - 0.25, 3)


def expect(name, reader, path, *, off=0, frames=None, parameters=None, **of):
    """`of` gives functions from the number of a frame to what was recorded; `off` is by how much pixels may differ on average."""
    numbers = range(FRAMES) if frames is None else frames
    rows = [{what: value(number) for what, value in of.items()} | {"picture": number} for number in numbers]
    EXPECTED[name] = {"reader": reader, "path": path, "off": off, "parameters": parameters or {}, "frames": rows}


def part(function):
    """Runs a part, unless a program or a package for it is missing."""
    try:
        function()
    except (ImportError, FileNotFoundError) as missing:
        LEFT_OUT[function.__name__] = str(missing)


def pandas_csv():
    import pandas

    folder = OUT / "csv"
    (folder / "images").mkdir(parents=True)
    for number in range(FRAMES):
        Image.fromarray(picture(number)).save(folder / f"images/cam_{number:04}.png")
    rows = [
        {"timestamp": 1.7e9 + number / 20, "image": f"cam_{number:04}.png", "steering_angle": steering(number) * 25,
         "throttle": 0.5, "speed": 3.6 * number}
        for number in range(FRAMES)
    ]
    pandas.DataFrame(rows).to_csv(folder / "labels.csv", index=False)
    expect("csv", "csv", "csv", parameters={"full_lock": 25, "speed_unit": "km/h"}, time=lambda n: n / 20,
           steering=steering, throttle=lambda n: 0.5, speed=float)


def ffmpeg(*arguments, data=None):
    command = ["ffmpeg", "-v", "error", "-nostdin", "-y", *map(str, arguments)]
    if data is not None:
        command.remove("-nostdin")
    return subprocess.run(command, check=True, input=data, capture_output=True, timeout=60).stdout


def raw():
    return b"".join(picture(number).tobytes() for number in range(FRAMES))


def encode(*options):
    return ffmpeg("-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{WIDTH}x{HEIGHT}", "-r", 10, "-i", "-", *options, data=raw())


X264 = ("-pix_fmt", "yuv420p", "-c:v", "libx264", "-crf", 4)


def videos():
    if shutil.which("ffmpeg") is None:
        raise FileNotFoundError("no ffmpeg on the PATH")
    codecs = {
        "b_frames.mp4": (*X264, "-bf", 2),
        "fragments.mp4": (*X264, "-bf", 2, "-g", 3, "-movflags", "frag_keyframe+empty_moov"),
        "ffv1.mkv": ("-c:v", "ffv1", "-pix_fmt", "yuv420p"),
        "mpeg4.avi": ("-c:v", "mpeg4", "-q:v", 1, "-bf", 2, "-pix_fmt", "yuv420p"),
        "vp9.webm": ("-c:v", "libvpx-vp9", "-crf", 4, "-b:v", 0, "-pix_fmt", "yuv420p"),
    }
    for name, options in codecs.items():
        folder = OUT / "video" / name.replace(".", "_")
        folder.mkdir(parents=True)
        encode(*options, folder / name)
        lines = "".join(f"{number},{steering(number)}\n" for number in range(FRAMES))
        (folder / "log.csv").write_text("frame,steering\n" + lines)
        expect(name, "video", str((folder).relative_to(OUT)), off=6, time=lambda n: n / 10, steering=steering)


def ros2_mcap():
    from mcap_ros2.writer import Writer

    header = "std_msgs/Header header\n"
    common = (
        "\n" + "=" * 80 + "\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n" + "=" * 80
        + "\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    )
    image = header + "uint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\nuint8[] data\n" + common
    compressed = header + "string format\nuint8[] data\n" + common
    drive = (
        header + "ackermann_msgs/AckermannDrive drive\n" + common + "=" * 80
        + "\nMSG: ackermann_msgs/AckermannDrive\nfloat32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\n"
        "float32 acceleration\nfloat32 jerk\n"
    )
    with open(OUT / "ros2.mcap", "wb") as file:
        writer = Writer(file)
        schemas = {
            "image": writer.register_msgdef("sensor_msgs/msg/Image", image),
            "compressed": writer.register_msgdef("sensor_msgs/msg/CompressedImage", compressed),
            "float": writer.register_msgdef("std_msgs/msg/Float64", "float64 data\n"),
            "drive": writer.register_msgdef("ackermann_msgs/msg/AckermannDriveStamped", drive),
        }
        for number in range(FRAMES):
            time = 1_700_000_000_000_000_000 + number * 50_000_000
            stamp = {"stamp": {"sec": 1_600_000_000 + number, "nanosec": 0}, "frame_id": "cam"}
            for encoding, pixels in [("rgb8", picture(number)), ("bgr8", picture(number)[..., ::-1]), ("mono8", picture(number)[..., 0])]:
                message = {
                    "header": stamp, "height": HEIGHT, "width": WIDTH, "encoding": encoding, "is_bigendian": 0,
                    "step": pixels.nbytes // HEIGHT, "data": pixels.tobytes(),
                }
                writer.write_message("/" + encoding, schemas["image"], message, time, time)
            message = {"header": stamp, "format": "png", "data": png(number)}
            writer.write_message("/png", schemas["compressed"], message, time, time)
            writer.write_message("/throttle", schemas["float"], {"data": 0.25}, time + 9_000_000, time)
            message = {"steering_angle": -steering(number), "steering_angle_velocity": 0, "speed": number, "acceleration": 0, "jerk": 0}
            writer.write_message("/drive", schemas["drive"], {"header": stamp, "drive": message}, time - 9_000_000, time)
        writer.finish()
    for topic in ("rgb8", "bgr8", "png"):
        expect("ros2 " + topic, "mcap", "ros2.mcap", time=lambda n: n / 20, steering=steering, throttle=lambda n: 0.25, speed=float,
               parameters={"image": "/" + topic, "full_lock": -1, "throttle": "/throttle"})
    expect("ros2 header", "mcap", "ros2.mcap", time=float, parameters={"image": "/rgb8", "steering": "none", "clock": "header"})


def png(number):
    import io

    into = io.BytesIO()
    Image.fromarray(picture(number)).save(into, "png")
    return into.getvalue()


def foxglove_mcap():
    from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
    from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
    from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
    from mcap_protobuf.writer import Writer

    with open(OUT / "foxglove.mcap", "wb") as file, Writer(file) as writer:
        for number in range(FRAMES):
            time = 1_700_000_000_000_000_000 + number * 50_000_000
            message = RawImage(width=WIDTH, height=HEIGHT, encoding="rgb8", step=WIDTH * 3, data=picture(number).tobytes())
            writer.write_message("/raw", message, time, time)
            writer.write_message("/png", CompressedImage(data=png(number), format="png"), time, time)
        for number, units in enumerate(pictures_of_stream()):
            time = 1_700_000_000_000_000_000 + number * 50_000_000
            writer.write_message("/h264", CompressedVideo(data=units, format="h264"), time, time)
    for topic in ("raw", "png"):
        expect("foxglove " + topic, "mcap", "foxglove.mcap", time=lambda n: n / 20, parameters={"image": "/" + topic})
    if shutil.which("ffmpeg") is None:
        raise FileNotFoundError("no ffmpeg on the PATH")
    expect("foxglove h264", "mcap", "foxglove.mcap", off=6, time=lambda n: n / 20, parameters={"image": "/h264"})


def pictures_of_stream():
    """The units of each picture of an H.264 stream without frames that are shown later, two of which can be decoded alone."""
    if shutil.which("ffmpeg") is None:
        return []
    stream = encode(*X264, "-bf", 0, "-g", 3, "-x264-params", "aud=1", "-f", "h264", "-")
    delimiter = b"\x00\x00\x00\x01\x09"
    return [delimiter + units for units in stream.split(delimiter)[1:]]


def rosbags_bag():
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    image, twist = (store.types[name] for name in ("sensor_msgs/msg/Image", "geometry_msgs/msg/Twist"))
    header, time_of = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    vector = store.types["geometry_msgs/msg/Vector3"]
    with Writer(OUT / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        camera = writer.add_connection("/camera", image.__msgtype__, typestore=store)
        command = writer.add_connection("/cmd_vel", twist.__msgtype__, typestore=store)
        for number in range(FRAMES):
            # A pause in the middle.
            time = 1_700_000_000_000_000_000 + number * 100_000_000 + (5_000_000_000 if number >= 3 else 0)
            stamp = header(stamp=time_of(sec=1, nanosec=2), frame_id="cam")
            message = image(header=stamp, height=HEIGHT, width=WIDTH, encoding="rgb8", is_bigendian=0, step=WIDTH * 3,
                            data=picture(number).reshape(-1))
            writer.write(camera, time, store.serialize_cdr(message, image.__msgtype__))
            message = twist(linear=vector(x=float(number), y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=steering(number)))
            writer.write(command, time, store.serialize_cdr(message, twist.__msgtype__))
    expect("rosbag2", "rosbag2", "bag", time=lambda n: n / 10 + (5 if n >= 3 else 0), steering=steering, speed=float)


def donkeycar_tub():
    from donkeycar.parts.tub_v2 import Tub

    inputs, types = ["cam/image_array", "user/angle", "user/throttle", "user/mode"], ["image_array", "float", "float", "str"]
    tub = Tub(str(OUT / "tub"), inputs, types, max_catalog_len=2)
    for number in range(FRAMES):
        tub.write_record({"cam/image_array": picture(number), "user/angle": steering(number), "user/throttle": 0.5, "user/mode": "user"})
    tub.delete_records([2])
    tub.close()
    expect("tub", "tub", "tub", off=12, frames=[0, 1, 3, 4, 5], steering=steering, throttle=lambda n: 0.5)


OUT = Path(sys.argv[1])
OUT.mkdir(parents=True, exist_ok=True)
for each in (pandas_csv, videos, ros2_mcap, foxglove_mcap, rosbags_bag, donkeycar_tub):
    part(each)
(OUT / "expected.json").write_text(json.dumps({"expected": EXPECTED, "left_out": LEFT_OUT}, indent=1) + "\n")
