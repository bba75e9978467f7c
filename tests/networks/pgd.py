"""Projected gradient descent in JAX, written from the paper, against what `pdk corrupt` made of the same frames with `pgd`. Both are measured by this program.

MODEL.onnx FRAMES PERTURBED EPSILON linf|l2 away|left|right; it needs pip install jax numpy onnx pillow.
"""
import sys, glob, os, numpy as np, onnx
from onnx import numpy_helper
import jax, jax.numpy as jnp
from PIL import Image
MODEL, FRAMES, PDK, EPS, NORM, GOAL = sys.argv[1], sys.argv[2], sys.argv[3], float(sys.argv[4]), sys.argv[5], sys.argv[6]
STEPS, STEP, SPEED = 10, .25, 8.0
m = onnx.load(MODEL); W = {t.name: numpy_helper.to_array(t) for t in m.graph.initializer}
def net(image):
    v = {k: jnp.asarray(w) for k, w in W.items()}; v['image'] = image; v['speed'] = jnp.array([[SPEED]], jnp.float32)
    for n in m.graph.node:
        a = {x.name: onnx.helper.get_attribute_value(x) for x in n.attribute}; i = [v[x] for x in n.input]
        if n.op_type == 'Constant': o = jnp.asarray(numpy_helper.to_array(a['value']))
        elif n.op_type == 'Div': o = i[0] / i[1]
        elif n.op_type == 'Sub': o = i[0] - i[1]
        elif n.op_type == 'Conv': o = jax.lax.conv_general_dilated(i[0], i[1], a['strides'], 'VALID') + i[2][None, :, None, None]
        elif n.op_type == 'Relu': o = jax.nn.relu(i[0])
        elif n.op_type == 'Flatten': o = i[0].reshape(1, -1)
        elif n.op_type == 'Concat': o = jnp.concatenate(i, 1)
        elif n.op_type == 'Gemm': o = i[0] @ (i[1].T if a.get('transB') else i[1]) + i[2]
        elif n.op_type == 'Tanh': o = jnp.tanh(i[0])
        else: raise SystemExit(n.op_type)
        v[n.output[0]] = o
    return v['control'][0, 0]
def taps(src, dst):
    A = np.zeros((dst, src), np.float32)
    for k in range(dst):
        c = min(max((k + .5) * src / dst - .5, 0), src - 1); f = int(c)
        A[k, f] += 1 - (c - f); A[k, min(f + 1, src - 1)] += c - f
    return jnp.asarray(A)
def make(h, w):
    H, Wd = [d.dim_value for d in m.graph.input[0].type.tensor_type.shape.dim][2:]
    R, C = taps(h, H), taps(w, Wd)
    f = lambda x: net(jnp.einsum('ih,hwc,jw->cij', R, x, C)[None])
    return jax.jit(f), jax.jit(jax.value_and_grad(f))
def attack(x0, rng, f, g):
    radius = EPS if NORM == 'linf' else EPS * np.sqrt(x0.size)
    before = float(f(x0)); best = (0, x0)
    for side in {'left': [-1], 'right': [1], 'away': [1, -1]}[GOAL]:
        d = rng.uniform(-1, 1, x0.shape).astype(np.float32)
        d *= radius if NORM == 'linf' else rng.uniform() * radius / np.linalg.norm(d)
        d = np.clip(x0 + d, 0, 255) - x0
        for k in range(STEPS):
            _, s = g(x0 + d); s = np.asarray(s) * side
            d = d + STEP * radius * (np.sign(s) if NORM == 'linf' else s / np.linalg.norm(s))
            if NORM == 'linf': d = np.clip(d, -radius, radius)
            d = np.clip(x0 + d, 0, 255) - x0
            if NORM == 'l2': d *= min(1, radius / np.linalg.norm(d))
        x = np.clip(np.round(x0 + d), 0, 255).astype(np.float32); s = float(f(x))
        score = abs(s - before) if GOAL == 'away' else side * (s - before)
        if score > best[0]: best = (score, x)
    return best[1]
rng = np.random.default_rng(1); rows = []
f = g = None
for p in sorted(glob.glob(FRAMES + '/*.png') + glob.glob(FRAMES + '/*.jpg')):
    q = os.path.join(PDK, os.path.basename(p))
    x0, theirs = [np.asarray(Image.open(a).convert('RGB'), np.float32) for a in (p, q)]
    if f is None: f, g = make(*x0.shape[:2])
    ours = attack(x0, rng, f, g)
    rows.append([float(f(x)) for x in (x0, theirs, ours)] + [np.abs(theirs - x0).max(), np.sqrt(np.mean((theirs - x0) ** 2)), np.sqrt(np.mean((ours - x0) ** 2))])
r = np.array(rows); pd, pl = np.abs(r[:, 1] - r[:, 0]), np.abs(r[:, 2] - r[:, 0])
print(f'{len(r)} frames, eps {EPS} {NORM} {GOAL}: mean |shift| pdk {pd.mean():.4f} jax {pl.mean():.4f} ratio {pd.mean()/pl.mean():.4f}; moved by > .1: pdk {np.mean(pd>.1):.3f} jax {np.mean(pl>.1):.3f}; > .3: {np.mean(pd>.3):.3f} {np.mean(pl>.3):.3f}; max change {r[:,3].max():.0f}, rms {r[:,4].max():.3f} jax {r[:,5].max():.3f}')
