"""What all figures share: who has which colour and sign, and how axes look."""
import csv

import matplotlib
matplotlib.use('Agg')
import matplotlib.pyplot as plt  # noqa: E402

# Colours that colour-blind people tell apart (Okabe, Ito 2008; Tol 2021), and a sign each besides.
LOOKS = {
    'event_driven': ('#000000', '*', 'event_driven (exact)'),
    'auto': ('#CC3311', 'o', 'auto (a ring)'),
    'brute_force': ('#777777', 'D', 'brute_force (exact)'),
    'continuous': ('#0072B2', 'o', 'continuous (exact at any step)'),
    'discrete': ('#D55E00', 's', 'discrete'),
    'soft_sphere': ('#009E73', '^', 'soft_sphere'),
    'bullet': ('#CC79A7', 'v', 'Bullet'),
    'ode': ('#882255', 'P', 'ODE'),
    'box2d': ('#56B4E9', 'X', 'Box2D (planar)'),
    'chipmunk': ('#E69F00', 'h', 'Chipmunk (planar)'),
    'mujoco': ('#AA4499', '<', 'MuJoCo'),
    'lammps': ('#999933', '>', 'LAMMPS granular'),
}
SPARE = [('#332288', 'p'), ('#88CCEE', '8'), ('#117733', 'd')]
PEERS = {'bullet', 'ode', 'box2d', 'chipmunk', 'mujoco', 'lammps'}

plt.rcParams.update({
    'font.size': 9,
    'axes.titlesize': 9.5,
    'axes.titleweight': 'bold',
    'axes.titlelocation': 'left',
    'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.grid': True,
    'grid.color': '#e4e4e4',
    'grid.linewidth': 0.6,
    'axes.axisbelow': True,
    'svg.hashsalt': 'ball_sim',
})


def look(name):
    """Colour, sign and label of an entrant; new ones get spare looks."""
    if name not in LOOKS:
        colour, sign = SPARE[len(name) % len(SPARE)]
        LOOKS[name] = (colour, sign, name)
    return LOOKS[name]


def marker_of(name, hollow=False):
    """How the points of an entrant are drawn."""
    colour = look(name)[0]
    if name == 'auto':
        return dict(markersize=15, markerfacecolor='none', markeredgecolor=colour,
                    markeredgewidth=1.2)
    return dict(markersize=11 if name == 'event_driven' else 5,
                markerfacecolor='white' if hollow else colour, markeredgecolor=colour)


def order(name):
    names = list(LOOKS)
    return names.index(name) if name in names else len(names)


def read(path):
    with open(path, newline='') as file:
        return list(csv.DictReader(file))


def value(row, field):
    """A number, or None where the row has none."""
    return float(row[field]) if row.get(field) else None


def mostly_failed(row):
    """Whether a row of chart.csv is of no use."""
    return int(row['failed']) * 2 >= int(row['runs'])


def save(figure, path):
    """A PNG of few colours: pictures of lines lose nothing by it, and shrink threefold."""
    from PIL import Image
    figure.savefig(path, dpi=100, metadata={'Software': None})
    plt.close(figure)
    with Image.open(path) as image:
        few = image.convert('RGB').quantize(200, kmeans=2, dither=0)
    few.save(path, optimize=True)
