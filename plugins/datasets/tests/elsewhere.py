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


AV1 = ("-c:v", "libaom-av1", "-cpu-used", 8)
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


def bag(name, plugin, image_of=None):
    """A bag of ROS 2, with the pictures as they are or as `image_of` makes them: the encoding, and pixels."""
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    image, twist = (store.types[name] for name in ("sensor_msgs/msg/Image", "geometry_msgs/msg/Twist"))
    header, time_of = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    vector = store.types["geometry_msgs/msg/Vector3"]
    with Writer(OUT / name, version=9, storage_plugin=plugin) as writer:
        camera = writer.add_connection("/camera", image.__msgtype__, typestore=store)
        command = writer.add_connection("/cmd_vel", twist.__msgtype__, typestore=store)
        for number in range(FRAMES):
            # A pause in the middle.
            time = 1_700_000_000_000_000_000 + number * 100_000_000 + (5_000_000_000 if number >= 3 else 0)
            stamp = header(stamp=time_of(sec=1, nanosec=2), frame_id="cam")
            encoding, pixels = ("rgb8", picture(number)) if image_of is None else image_of(number)
            message = image(header=stamp, height=HEIGHT, width=WIDTH, encoding=encoding, is_bigendian=0, step=pixels.nbytes // HEIGHT,
                            data=pixels.reshape(-1))
            writer.write(camera, time, store.serialize_cdr(message, image.__msgtype__))
            message = twist(linear=vector(x=float(number), y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=steering(number)))
            writer.write(command, time, store.serialize_cdr(message, twist.__msgtype__))


def bag_time(number):
    return number / 10 + (5 if number >= 3 else 0)


def rosbags_bag():
    from rosbags.rosbag2 import StoragePlugin

    bag("bag", StoragePlugin.MCAP)
    expect("rosbag2", "rosbag2", "bag", parameters={"full_lock": 1}, time=bag_time, steering=steering, speed=float)


def mosaic(number):
    """What a sensor sees whose first row is red, green, red and so on, and whose second is green, blue, green."""
    whole = picture(number)
    pixels = whole[..., 1].copy()
    pixels[0::2, 0::2], pixels[1::2, 1::2] = whole[0::2, 0::2, 0], whole[1::2, 1::2, 2]
    return "bayer_rggb8", pixels


def rosbags_sqlite():
    from rosbags.rosbag2 import StoragePlugin

    bag("bag_sqlite", StoragePlugin.SQLITE3)
    expect("rosbag2 sqlite", "rosbag2", "bag_sqlite", parameters={"full_lock": 1}, time=bag_time, steering=steering, speed=float)
    bag("bag_bayer", StoragePlugin.SQLITE3, mosaic)
    expect("rosbag2 bayer", "rosbag2", "bag_bayer", off=0.75, parameters={"full_lock": 1}, time=bag_time, steering=steering, speed=float)


def rosbags_foxglove():
    """Pictures and an H.264 stream in Foxglove's messages of ROS 2, and in CompressedImage."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    start = "builtin_interfaces/Time timestamp\nstring frame_id\n"
    bodies = {
        "CompressedImage": "uint8[] data\nstring format\n",
        "CompressedVideo": "uint8[] data\nstring format\n",
        "RawImage": "uint32 width\nuint32 height\nstring encoding\nuint32 step\nuint8[] data\n",
    }
    for name, body in bodies.items():
        store.register(get_types_from_msg(start + body, f"foxglove_msgs/msg/{name}"))
    stamp = store.types["builtin_interfaces/msg/Time"](sec=1, nanosec=2)
    header = store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="cam")
    time = {"timestamp": stamp, "frame_id": "cam"}
    stream = pictures_of_stream()
    with Writer(OUT / "bag_foxglove", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connections = {}
        for number in range(FRAMES):
            data = np.frombuffer(png(number), np.uint8)
            messages = {
                "raw": ("foxglove_msgs/msg/RawImage", {**time, "width": WIDTH, "height": HEIGHT, "encoding": "rgb8", "step": WIDTH * 3,
                                                       "data": picture(number).reshape(-1)}),
                "png": ("foxglove_msgs/msg/CompressedImage", {**time, "data": data, "format": "png"}),
                "ros": ("sensor_msgs/msg/CompressedImage", {"header": header, "data": data, "format": "png"}),
            }
            if stream:
                units = np.frombuffer(stream[number], np.uint8)
                messages["h264"] = "foxglove_msgs/msg/CompressedVideo", {**time, "data": units, "format": "h264"}
            for topic, (kind, fields) in messages.items():
                if topic not in connections:
                    connections[topic] = writer.add_connection("/" + topic, kind, typestore=store)
                message = store.serialize_cdr(store.types[kind](**fields), kind)
                writer.write(connections[topic], 1_700_000_000_000_000_000 + number * 50_000_000, message)
    for topic in connections:
        expect("rosbag2 foxglove " + topic, "rosbag2", "bag_foxglove", off=6 if topic == "h264" else 0, time=lambda n: n / 20,
               parameters={"image": "/" + topic})


def comma2k19():
    if shutil.which("ffmpeg") is None:
        raise FileNotFoundError("no ffmpeg on the PATH")
    folder = OUT / "comma2k19"
    for segment in range(2):
        inside = folder / "b0c9d2329ad1606b|2018-08-02--08-34-47" / str(9 + segment)
        poses, log = inside / "global_pose", inside / "processed_log" / "CAN"
        for each in (poses, log / "steering_angle", log / "speed"):
            each.mkdir(parents=True)
        encode("-c:v", "libx265", "-x265-params", "log-level=error:crf=4:bframes=2", "-pix_fmt", "yuv420p", "-f", "hevc", inside / "video.hevc")
        times = 1000.0 + segment * FRAMES / 20 + np.arange(FRAMES) / 20
        # The log has more than frames, and values of its own shape.
        arrays = {
            poses / "frame_times": times,
            log / "steering_angle" / "t": np.repeat(times, 2) + np.tile([0, 0.02], FRAMES),
            log / "steering_angle" / "value": -400.0 * np.repeat([steering(number) for number in range(FRAMES)], 2),
            log / "speed" / "t": times + 0.004,
            log / "speed" / "value": np.arange(FRAMES, dtype=np.float64)[:, None],
        }
        for path, array in arrays.items():
            with open(path, "wb") as file:
                np.save(file, array)
    frames = [*range(FRAMES)] * 2
    expect("comma2k19", "comma2k19", "comma2k19", off=6, parameters={"full_lock": -400}, frames=frames, steering=steering, speed=float)
    for place, frame in enumerate(EXPECTED["comma2k19"]["frames"]):
        frame["time"] = place / 20


def info(version, codec, **paths):
    picture = {"dtype": "video", "shape": [HEIGHT, WIDTH, 3], "names": ["height", "width", "channels"], "info": {"video.codec": codec}}
    features = {
        "observation.images.front": picture,
        "observation.state": {"dtype": "float32", "shape": [1], "names": {"axes": ["speed"]}},
        "action": {"dtype": "float32", "shape": [3], "names": ["gas", "brake", "steering"]},
        "timestamp": {"dtype": "float32", "shape": [1], "names": None},
        "frame_index": {"dtype": "int64", "shape": [1], "names": None},
        "episode_index": {"dtype": "int64", "shape": [1], "names": None},
    }
    return {"codebase_version": version, "fps": 10, "total_episodes": 2, "total_frames": 2 * FRAMES, "chunks_size": 1000,
            "features": features, **paths}


def episode(number):
    """The columns of an episode, as LeRobot has them."""
    frames = range(FRAMES)
    return {
        "observation.state": [np.array([float(frame)], np.float32) for frame in frames],
        "action": [np.array([0.75, 0.25, steering(frame)], np.float32) for frame in frames],
        "timestamp": np.arange(FRAMES, dtype=np.float32) / np.float32(10),
        "frame_index": np.arange(FRAMES),
        "episode_index": np.full(FRAMES, number),
        "index": np.arange(FRAMES) + number * FRAMES,
    }


def expect_lerobot(name):
    # What `float32` keeps of it.
    single = lambda number: float(np.float32(steering(number)))
    expect(name, "lerobot", name, off=6, frames=[*range(FRAMES)] * 2, steering=single, throttle=lambda n: 0.5, speed=float,
           time=lambda n: float(np.float32(n) / np.float32(10)))


def lerobot_2():
    import pandas

    folder = OUT / "lerobot_2"
    data = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
    video = "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4"
    (folder / "meta").mkdir(parents=True)
    (folder / "meta/info.json").write_text(json.dumps(info("v2.1", "h264", data_path=data, video_path=video), indent=4))
    for number in range(2):
        numbers = {"episode_chunk": 0, "episode_index": number, "video_key": "observation.images.front"}
        for path in (data, video):
            (folder / path.format(**numbers)).parent.mkdir(parents=True, exist_ok=True)
        pandas.DataFrame(episode(number)).to_parquet(folder / data.format(**numbers))
        encode(*X264, "-bf", 2, folder / video.format(**numbers))
    expect_lerobot("lerobot_2")


def lerobot_3():
    import pyarrow
    from pyarrow import parquet

    folder, camera = OUT / "lerobot_3", "observation.images.front"
    data = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
    video = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
    numbers = {"chunk_index": 0, "file_index": 0, "video_key": camera}
    for path in ("meta/episodes/chunk-000/file", data, video):
        (folder / path.format(**numbers)).parent.mkdir(parents=True)
    (folder / "meta/info.json").write_text(json.dumps(info("v3.0", "av1", data_path=data, video_path=video), indent=4))
    columns = [episode(number) for number in range(2)]
    joined = {name: [row for of in columns for row in of[name]] for name in columns[0]}
    kinds = {"observation.state": pyarrow.list_(pyarrow.float32(), 1), "action": pyarrow.list_(pyarrow.float32()), "timestamp": pyarrow.float32()}
    table = pyarrow.table({name: pyarrow.array(rows, kinds.get(name, pyarrow.int64())) for name, rows in joined.items()})
    parquet.write_table(table, folder / data.format(**numbers), compression="snappy", row_group_size=5)
    begins = {"chunk_index": [0, 0], "file_index": [0, 0], "from_timestamp": [0.0, FRAMES / 10], "to_timestamp": [FRAMES / 10, 2 * FRAMES / 10]}
    episodes = {"episode_index": [0, 1], "tasks": [["drive"], ["drive"]], **{f"videos/{camera}/{name}": rows for name, rows in begins.items()}}
    parquet.write_table(pyarrow.table(episodes), folder / "meta/episodes/chunk-000/file-000.parquet")
    ffmpeg("-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{WIDTH}x{HEIGHT}", "-r", 10, "-i", "-", *AV1, "-crf", 4, "-g", 2,
           "-pix_fmt", "yuv420p", folder / video.format(**numbers), data=raw() * 2)
    expect_lerobot("lerobot_3")


def donkeycar_tub():
    from donkeycar.parts.tub_v2 import Tub

    inputs, types = ["cam/image_array", "user/angle", "user/throttle", "user/mode"], ["image_array", "float", "float", "str"]
    tub = Tub(str(OUT / "tub"), inputs, types, max_catalog_len=2)
    for number in range(FRAMES):
        tub.write_record({"cam/image_array": picture(number), "user/angle": steering(number), "user/throttle": 0.5, "user/mode": "user"})
    tub.delete_records([2])
    tub.close()
    expect("tub", "tub", "tub", off=12, frames=[0, 1, 3, 4, 5], steering=steering, throttle=lambda n: 0.5)


def donkeycar_tub_1():
    from donkeycar.parts.datastore import Tub

    inputs, types = ["cam/image_array", "user/angle", "user/throttle", "user/mode"], ["image_array", "float", "float", "str"]
    tub = Tub(str(OUT / "tub_1"), inputs=inputs, types=types)
    for number in range(FRAMES):
        tub.put_record({"cam/image_array": picture(number), "user/angle": steering(number), "user/throttle": 0.5, "user/mode": "user"})
    expect("tub_1", "folder", "tub_1", off=12, steering=steering, throttle=lambda n: 0.5)


OUT = Path(sys.argv[1])
OUT.mkdir(parents=True, exist_ok=True)
PARTS = (
    pandas_csv, videos, ros2_mcap, foxglove_mcap, rosbags_bag, rosbags_sqlite, rosbags_foxglove, comma2k19, lerobot_2, lerobot_3,
    donkeycar_tub, donkeycar_tub_1,
)
for each in PARTS:
    part(each)
(OUT / "expected.json").write_text(json.dumps({"expected": EXPECTED, "left_out": LEFT_OUT}, indent=1) + "\n")
