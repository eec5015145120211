#!/usr/bin/python3
"""Draws speed against accuracy, one figure a scene, and one with the main panel of six scenes.

usage: draw_chart.py DATA_FOLDER FIGURE_FOLDER

Reads chart.csv (see summarise.py), chart_scenes.csv and chart_machine.csv, and nothing else.
"""
import collections
import os
import sys
import textwrap

import figure_style as style
from figure_style import mostly_failed, plt, value

COST = 'CPU seconds per simulated second'
FLOOR = 1e-17  # a double's last bit; zeros are drawn here
OVERVIEW = ['two_balls', 'pi_billiard', 'twelve_discs', 'bouncing', 'break_shot', 'box_gas']


def lines(rows):
    """Rows by entrant, in the order of the legend, long steps first."""
    groups = collections.defaultdict(list)
    for row in rows:
        if int(row['k']) >= 0 and (row['cost'] or row['failed'] != '0'):
            groups[row['entrant']].append(row)
    for name in sorted(groups, key=style.order):
        yield name, sorted(groups[name], key=lambda row: int(row['k']))


def draw_lines(axes, rows, measure, floor=FLOOR, hollow=False, lower=None, upper=None):
    """One line an entrant; where most runs failed, a cross at the top edge."""
    useful = [value(row, 'cost') for row in rows if row['cost'] and not mostly_failed(row)]
    fastest = min(useful, default=1e-9)  # runs that lost their balls cost nothing: to the left edge
    slowest = max(useful, default=1e-9)  # those without an end: to the right edge
    for name, points in lines(rows):
        colour, sign, _ = style.look(name)
        good = [p for p in points if not mostly_failed(p) and measure(p) is not None]
        x = [value(p, 'cost') for p in good]
        y = [max(measure(p), floor) for p in good]
        axes.plot(x, y, color=colour, marker=sign, linewidth=1.1,
                  linestyle='--' if name in style.PEERS else '-',
                  zorder=5 if name == 'event_driven' else 3, **style.marker_of(name, hollow))
        if lower and upper:
            for p, cost in zip(good, x):
                low, high = lower(p), upper(p)
                if low is not None and high is not None:
                    axes.plot([cost, cost], [max(low, floor), max(high, floor)], color=colour,
                              linewidth=0.7, alpha=0.6, zorder=2)
        failed = [max(value(p, 'cost') or slowest * 2, fastest / 4)
                  for p in points if mostly_failed(p)]
        top = axes.get_xaxis_transform()
        axes.plot(failed, [0.985] * len(failed), color=colour, marker='x', linestyle='none',
                  markersize=5, transform=top, clip_on=False, zorder=4)
    axes.set_xscale('log')
    axes.set_yscale('log')
    axes.margins(x=0.08)


def set_heights(axes, low, high):
    """The same for every scene, so that scenes compare; failed runs stand at the upper edge."""
    axes.set_ylim(low, high)
    left, right = axes.get_xlim()
    if right < left * 100:  # a single point has no width
        middle = (left * right) ** 0.5
        axes.set_xlim(middle / 10, middle * 10)


def field(name):
    return lambda row: value(row, name)


def draw_error(axes, rows):
    draw_lines(axes, rows, field('error'), lower=field('error_q1'), upper=field('error_q3'))
    axes.axhline(0.01, color='#b0b0b0', linewidth=0.8, linestyle=':')
    axes.set_ylabel('largest error at the end / R')
    set_heights(axes, FLOOR / 3, 1e4)


def draw_valid_time(axes, rows, horizon):
    draw_lines(axes, rows, field('valid_time'), floor=horizon * 5e-3)
    axes.axhline(horizon, color='#b0b0b0', linewidth=0.8, linestyle=':')
    axes.set_ylabel('time right to 0.01 R, s')
    set_heights(axes, horizon * 3e-3, horizon * 3)


def draw_missed(axes, rows):
    draw_lines(axes, rows, field('missed'), floor=1e-4)
    draw_lines(axes, rows, field('extra'), floor=1e-4, hollow=True)
    axes.set_ylabel('share of the true impacts')
    set_heights(axes, 5e-5, 1e2)


def off_by(measured, true):
    def measure(row):
        got, wanted = value(row, measured), value(row, true)
        return abs(got / wanted - 1) if got is not None and wanted else None
    return measure


def draw_statistics(axes, rows):
    draw_lines(axes, rows, off_by('rate', 'true_rate'), floor=1e-4)
    draw_lines(axes, rows, off_by('pressure', 'true_pressure'), floor=1e-4, hollow=True)
    noise = [value(row, 'noise') for row in rows if value(row, 'noise')]
    if noise:
        axes.axhspan(5e-5, max(noise), color='#eeeeee', zorder=0)
        axes.text(0.98, 6e-5, 'grey: chance, 1/√n', fontsize=7.5, color='#606060', ha='right',
                  va='bottom', transform=axes.get_yaxis_transform())
    axes.set_ylabel('relative error')
    set_heights(axes, 5e-5, 10)


def no_panel(axes, why):
    axes.set_axis_off()
    axes.text(0.5, 0.5, why, ha='center', va='center', color='#606060', transform=axes.transAxes)


def failures(rows):
    """What failed, one line an entrant and reason."""
    found = collections.OrderedDict()
    for row in sorted(rows, key=lambda r: (style.order(r['entrant']), int(r['k']))):
        if row['failure'] and not row['failure'].startswith('left out'):
            found.setdefault((row['entrant'], row['failure']), []).append(row)
    notes = []
    for (name, why), some in found.items():
        steps = [value(row, 'step') for row in some]
        runs = '%d of %d runs' % (sum(int(r['failed']) for r in some),
                                  sum(int(r['runs']) for r in some))
        span = '%.2g s' % steps[0] if len(steps) == 1 else '%.2g to %.2g s' % (max(steps),
                                                                             min(steps))
        label = style.look(name)[2].split(' (')[0]
        notes.append('%s: %s (%s at steps of %s)' % (label, why, runs, span))
    return notes


def left_out(rows):
    reasons = collections.OrderedDict()
    for row in rows:
        if row['failure'].startswith('left out: '):
            reasons.setdefault(row['failure'][10:], []).append(
                style.look(row['entrant'])[2].split(' (')[0])
    return ['%s: %s' % (', '.join(names), why) for why, names in reasons.items()]


def lay_out(figure, names, notes):
    """From the bottom: the small print, the legend, the panels; all in inches."""
    height = figure.get_size_inches()[1]
    small_print = 0.12 + 0.145 * (notes.count('\n') + 1)
    figure.text(0.01, 0.08 / height, notes, fontsize=7.5, color='#404040', va='bottom',
                linespacing=1.25)
    legend_rows = (len(names) + 1 + 5) // 6
    legend(figure, names, loc='lower center', ncol=6, bbox_to_anchor=(0.5, small_print / height))
    bottom = small_print + 0.25 * legend_rows + 0.55
    figure.subplots_adjust(left=0.065, right=0.99, wspace=0.24, hspace=0.42, bottom=bottom / height,
                           top=1 - 0.75 / height)


def legend_size(name):
    return {'event_driven': 10, 'auto': 8}.get(name, 5)


def legend(figure, names, **where):
    handles = []
    for name in sorted(names, key=style.order):
        colour, sign, label = style.look(name)
        handles.append(plt.Line2D([], [], color=colour, marker=sign, label=label, linewidth=1.1,
                                  linestyle='--' if name in style.PEERS else '-',
                                  **dict(style.marker_of(name), markersize=legend_size(name))))
    handles.append(plt.Line2D([], [], color='#404040', marker='x', linestyle='none',
                              label='failed (most runs)'))
    figure.legend(handles=handles, frameon=False, fontsize=8, columnspacing=1.2,
                  handletextpad=0.5, **where)


def note_text(scene, rows):
    notes = ['R: the smallest sum of two radii. Each point is a time step, from the left R/v, R/2v, R/4v '
             'and so on, median of up to 20 starting phases, bars: quartiles; exact methods but '
             'continuous have no step. Dotted: 0.01 R, and the end of the comparison. The true paths: '
             '%s.' % scene['truth']]
    failed = failures(rows)
    if failed:
        notes.append('× failed: ' + '; '.join(failed) + '.')
    out = left_out(rows)
    if out:
        notes.append('Left out: ' + '; '.join(out) + '.')
    return '\n'.join(textwrap.fill(note, 190) for note in notes)


def draw_scene(scene, rows, machine, path):
    paths = [row for row in rows if row['part'] == 'path']
    long_runs = [row for row in rows if row['part'] == 'statistics']
    figure, panels = plt.subplots(2, 3, figsize=(11.5, 8))
    (error, valid, energy), (overlap, missed, rates) = panels
    error.set_title('1a  Paths: how far off at the end')
    draw_error(error, paths)
    valid.set_title('1b  Paths: for how long they hold')
    draw_valid_time(valid, paths, float(scene['horizon']))
    energy.set_title('2a  Energy: relative error')
    draw_lines(energy, paths, field('energy_error'))
    energy.set_ylabel('|energy - true| / energy')
    set_heights(energy, FLOOR / 3, 1e3)
    overlap.set_title('2b  Deepest overlap')
    draw_lines(overlap, paths, field('overlap'))
    overlap.set_ylabel('overlap / R')
    set_heights(overlap, FLOOR / 3, 1e3)
    missed.set_title('3  Impacts missed (hollow: made up)')
    if any(value(row, 'missed') is not None for row in paths):
        draw_missed(missed, paths)
    else:
        no_panel(missed, 'there are no impacts to miss:\nnothing moves')
    rates.set_title('4  Collision rate (hollow: pressure)')
    if long_runs:
        draw_statistics(rates, long_runs)
    else:
        no_panel(rates, 'too few balls for statistics')
    for axes in panels.flat:
        axes.set_xlabel(COST)
    figure.suptitle('%s: %s' % (scene['scene'], scene['question']), x=0.01, ha='left',
                    fontsize=12, fontweight='bold')
    notes = note_text(scene, rows)
    names = {row['entrant'] for row in rows if int(row['k']) >= 0}
    lay_out(figure, names, notes + '\n' + machine)
    style.save(figure, path)


def draw_overview(scenes, rows, machine, path):
    figure, panels = plt.subplots(2, 3, figsize=(10.5, 7.6))
    names = set()
    for axes, name in zip(panels.flat, OVERVIEW):
        some = [row for row in rows if row['scene'] == name and row['part'] == 'path']
        if not some:
            no_panel(axes, name + ': not measured')
            continue
        draw_error(axes, some)
        axes.set_title(textwrap.fill(scenes[name]['question'], 40), fontsize=9)
        axes.set_ylabel('')
        axes.set_xlabel(COST)
        names |= {row['entrant'] for row in some if int(row['k']) >= 0}
    figure.suptitle('Speed against accuracy: left is faster, down is more accurate\n', x=0.01,
                    ha='left', fontsize=12.5, fontweight='bold')
    lay_out(figure, names, textwrap.fill(
        'Each line is one method at steps from R/v (left) to finer and finer ones (right), each '
        'point the median of up to 20 starting phases, bars its quartiles; R: sum of two radii, v: '
        'typical speed. Error: of the ball that is furthest off, against 256-bit arithmetic. '
        'Dotted: 0.01 R. × : most runs failed (a ball left through a wall, energy doubled, a crash, '
        'no end).', 165) + '\n' + machine)
    style.save(figure, path)


def main():
    data, figures = sys.argv[1:3]
    rows = style.read(os.path.join(data, 'chart.csv'))
    scenes = {row['scene']: row for row in style.read(os.path.join(data, 'chart_scenes.csv'))}
    machine_rows = style.read(os.path.join(data, 'chart_machine.csv'))
    facts = {row['fact']: row['value'] for row in machine_rows}
    machine = '{cpu}, one thread; {compiler}, {flags}; commit {commit}.'.format(**facts)
    machine = textwrap.fill(machine, 165)
    os.makedirs(figures, exist_ok=True)
    for name, scene in scenes.items():
        some = [row for row in rows if row['scene'] == name]
        if some:
            draw_scene(scene, some, machine, os.path.join(figures, 'chart_%s.png' % name))
    draw_overview(scenes, rows, machine, os.path.join(figures, 'chart.png'))


if __name__ == '__main__':
    main()
