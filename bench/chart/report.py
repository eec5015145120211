#!/usr/bin/python3
"""Prints the results that are kept in bench/results, and the numbers that texts quote.

usage: report.py DATA_FOLDER > RESULTS.md

Reads chart.csv (see summarise.py), chart_scenes.csv, chart_machine.csv, scaling.csv, and
stability_map.csv where it is there.
"""
import math
import os
import sys

import figure_style as style
from figure_style import mostly_failed, value

GAS_STEPS = [1, 2, 4, 6, 7]  # k of the steps R/v 2^-k that the gas's table shows
TWO_BALLS_STEPS = [0, 2, 4, 6, 8, 10]
TOLERANCE = 1e-6  # of R, what a scene without a tolerance asks of auto
SHORTEST_RUN = 1e-5  # s of CPU time
STACK_TOLERANCE = 0.01  # a stack hums: no method is right to 1e-6 of R
PACKING_FRACTIONS = ['0.05', '0.2', '0.49']


def short(number, digits=2):
    return '-' if number is None else '%.*g' % (digits, number)


def print_table(header, rows):
    print('| ' + ' | '.join(header) + ' |')
    print('|' + '---|' * len(header))
    for row in rows:
        print('| ' + ' | '.join(row) + ' |')
    print()


class Chart:
    """The rows of chart.csv."""

    def __init__(self, rows):
        self.rows = [row for row in rows if int(row['k']) >= 0]

    def some(self, **wanted):
        return [row for row in self.rows if all(row[f] == str(w) for f, w in wanted.items())]

    def one(self, **wanted):
        found = self.some(**wanted)
        return found[0] if found else None

    def entrants(self, scene):
        return sorted({row['entrant'] for row in self.some(scene=scene)}, key=style.order)


def print_head(machine):
    facts = {row['fact']: row['value'] for row in machine}
    print('# Speed against accuracy, %s\n' % facts['date'])
    print('Machine: %s. CPU times of one thread, medians.' % facts['cpu'])
    print('Compiler: %s, %s. Commit: %s.' % (facts['compiler'], facts['flags'], facts['commit']))
    peers = [row for row in machine if row['fact'].startswith('lib')]
    if peers:
        print('Peers: ' + ', '.join('%(fact)s %(value)s' % row for row in peers) + '.')
    print('\n    scripts/chart\n')
    print('Data: `doc/data`, figures: `doc/figures`. R: smallest sum of two radii. Error: of the ball '
          'that is furthest off at the horizon.\n')


def gas_row(chart, name, k):
    path = chart.one(part='path', scene='box_gas', entrant=name, k=k)
    long_run = chart.one(part='statistics', scene='box_gas', entrant=name, k=k)
    if not path and not long_run:
        return None
    exact = name in ('event_driven', 'auto')
    some = long_run or path
    line = [name, '-' if exact else short(value(some, 'step'))]
    line.append(short(long_run and value(long_run, 'cost')))
    if long_run and mostly_failed(long_run):
        return line + [long_run['failure'], '', '', '']
    for field, digits in [('energy_error', 2), ('overlap', 2), ('rate', 4)]:
        line.append(short(long_run and value(long_run, field), digits))
    right = path and not mostly_failed(path)
    return line + [short(value(path, 'error')) if right else path['failure'] if path else '-']


def print_gas(chart):
    print('## A thousand balls in a closed cube, packing fraction 0.1 (box_gas)\n')
    truth = chart.one(part='statistics', scene='box_gas', entrant='event_driven')
    if truth:
        print('One simulated second but for the error, which is at 0.1 s. The true rate is %s '
              'collisions per ball and second,\nin an exact run ten times as long; one second of it '
              'tells %s.\n' % (short(value(truth, 'true_rate'), 4), short(value(truth, 'noise'), 1)))
    rows = []
    for name in chart.entrants('box_gas'):
        for k in [0] if name in ('event_driven', 'auto') else GAS_STEPS:
            row = gas_row(chart, name, k)
            if row:
                rows.append(row)
    print_table(['', 'step, s', 'CPU s', 'energy error', 'deepest overlap / R',
                 'collisions per ball and s', 'error at 0.1 s / R'], rows)


def print_two_balls(chart):
    print('## Two balls, once (two_balls)\n')
    print('Largest error 6 s after the impact, medians of 20 phases.\n')
    reference = chart.some(part='path', scene='two_balls', entrant='discrete')
    steps = {int(row['k']): value(row, 'step') for row in reference}
    columns = [k for k in TWO_BALLS_STEPS if k in steps]
    rows = []
    for name in chart.entrants('two_balls'):
        if name in ('event_driven', 'brute_force', 'auto'):
            continue
        line = [name]
        for k in columns:
            row = chart.one(part='path', scene='two_balls', entrant=name, k=k)
            line.append(short(value(row, 'error')) if row and not mostly_failed(row) else '-')
        rows.append(line)
    print_table(['step, s'] + [short(steps[k]) for k in columns], rows)
    exact = chart.one(part='path', scene='two_balls', entrant='event_driven')
    if exact:
        print('event_driven, without a step: %s\n' % short(value(exact, 'error')))


def magnitude(row):
    """Of the number of balls: filling by tiles leaves some out."""
    return round(math.log10(value(row, 'balls')))


def print_collision_costs(scaling):
    print('## Cost of a collision\n')
    print('Periodic cube, equal spheres, in equilibrium, random order in memory: microseconds per '
          'ball-ball collision, median of 3.\n')
    counts = sorted({magnitude(row) for row in scaling})
    rows = []
    for method in sorted({row['method'] for row in scaling}, key=style.order):
        for fraction in PACKING_FRACTIONS:
            cost = {magnitude(row): value(row, 'ns_per_collision') / 1000 for row in scaling
                    if row['method'] == method and float(row['packing_fraction']) == float(fraction)}
            rows.append([method, fraction] + [short(cost.get(n), 3) for n in counts])
    print_table(['', 'packing fraction'] + ['10^%d' % n for n in counts], rows)


def cheapest(chart, scene, names, tolerance):
    """Cost and name of the cheapest of the methods that is right to the tolerance."""
    keeping = [(value(row, 'cost'), row['entrant']) for row in chart.some(part='path', scene=scene)
               if row['entrant'] in names and row['failed'] == '0' and row['error'] and
               value(row, 'error') <= tolerance]
    return min(keeping, default=(None, '-'))


def print_auto(chart, scenes):
    print('## auto beside the cheapest method that is right\n')
    print('CPU time of the run up to the horizon, set-up apart. Right: to %g of R; the stack: to %g. '
          'Runs of less than %g us\ndo not count: there it is the calls that cost.\n' %
          (TOLERANCE, STACK_TOLERANCE, SHORTEST_RUN * 1e6))
    rows = []
    for scene in scenes:
        name = scene['scene']
        auto = chart.one(part='path', scene=name, entrant='auto')
        if not auto:
            continue
        tolerance = STACK_TOLERANCE if name == 'stack' else TOLERANCE
        fast = ['event_driven', 'continuous', 'discrete', 'soft_sphere']
        cost, best = cheapest(chart, name, fast, tolerance)
        plain, _ = cheapest(chart, name, ['brute_force'], tolerance)
        if not cost:
            continue
        whole = cost * float(scene['horizon'])  # s
        ratio = '%.2f' % (value(auto, 'cost') / cost)
        rows.append([name, '%.3g' % (1e6 * value(auto, 'cost') * float(scene['horizon'])),
                     short(value(auto, 'error')), best, '%.3g' % (1e6 * whole),
                     ratio if whole >= SHORTEST_RUN else '(%s)' % ratio,
                     '%.3g' % (1e6 * plain * float(scene['horizon'])) if plain else '-'])
    print_table(['scene', 'auto, us', 'its error / R', 'cheapest', 'us', 'auto / cheapest',
                 'brute_force, us, no choice of auto'], rows)


def print_truths(scenes):
    print('## What stands behind each scene\n')
    print_table(['scene', 'compared up to, s', 'the true paths'],
                [[s['scene'], s['horizon'], s['truth']] for s in scenes])


def print_quoted(chart, scaling, stability):
    print('## Quoted in texts\n')
    gas = dict(part='statistics', scene='box_gas')
    exact = chart.one(entrant='event_driven', **gas)
    if exact:
        print('- doc/method.md, event_driven: energy error %s, overlaps %s R in box_gas' %
              (short(value(exact, 'energy_error')), short(value(exact, 'overlap'))))
    pair = [chart.one(part='path', scene='two_balls', entrant='discrete', k=k) for k in (0, 6, 10)]
    if all(pair):
        print('- doc/method.md, discrete: two balls that meet once are ' + ', '.join(
            '%s R off at %s s' % (short(value(row, 'error')), short(value(row, 'step')))
            for row in pair))
    coarse = chart.one(entrant='discrete', k=1, **gas)
    if coarse:
        print('- doc/method.md, discrete: %s instead of %s collisions a second at a step of %s s' % (
            short(value(coarse, 'rate'), 3), short(value(coarse, 'true_rate'), 3),
            short(value(coarse, 'step'))))
    soft = [value(row, 'step') for row in chart.some(entrant='soft_sphere', **gas)
            if mostly_failed(row)]
    if soft:
        print('- doc/method.md, soft_sphere: balls through walls of box_gas down to a step of %s s' %
              short(min(soft)))
    errors = [value(row, 'error') for row in chart.some(part='path', entrant='event_driven')
              if row['scene'] != 'stack' and row['error']]
    if errors:
        print('- doc/method.md, How to choose: event_driven is right to %s R on every scene but the '
              'stack' % short(max(errors), 1))
    stack = chart.one(part='path', scene='stack', entrant='event_driven')
    if stack:
        print('- doc/method.md, Contact that lasts: the stack is right to %s R' %
              short(value(stack, 'error')))
    large = [value(row, 'ns_per_collision') for row in scaling
             if row['method'] == 'continuous' and row['packing_fraction'] == '0.05' and
             magnitude(row) == 6]
    if large:
        print('- doc/performance.md: continuous at 0.05 and 10^6 balls: %.0f k/s' % (1e6 / large[0]))
    for method in ('discrete', 'soft_sphere'):
        bad = [value(row, 'speed_time_step_per_radius') for row in stability
               if row['method'] == method and row['verdict'] != 'holds' and
               row['map'] == 'packing_fraction' and row['packing_fraction'] == '0.2']
        if bad:
            print('- doc/method.md, Where each fails: %s at packing fraction 0.2 from %s R a step' %
                  (method, short(min(bad), 1)))


def main():
    data = sys.argv[1]

    def read(name):
        path = os.path.join(data, name)
        return style.read(path) if os.path.exists(path) else []

    scenes = read('chart_scenes.csv')
    chart = Chart(read('chart.csv'))
    scaling = read('scaling.csv')
    print_head(read('chart_machine.csv'))
    print_truths(scenes)
    print_gas(chart)
    print_two_balls(chart)
    print_auto(chart, scenes)
    print_collision_costs(scaling)
    print_quoted(chart, scaling, read('stability_map.csv'))


if __name__ == '__main__':
    main()
