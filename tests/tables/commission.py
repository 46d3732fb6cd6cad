"""The tables of docs/commands/commission.md: what few sessions prove, by the rules of the command."""

import math

from markdown import table

ONE_SIGMA, TWO_SIGMA = 0.6827, 0.9545  # what normal errors have within one and within two sigma
TAIL = 0.025                           # on each side of a 95 % interval


def binomial(successes, trials, share):
    return math.comb(trials, successes) * share**successes * (1 - share)**(trials - successes)


def most_that_fail(trials, share):
    """The largest number of successes whose interval (Clopper and Pearson) lies below a share."""
    successes, cumulated = -1, 0.0
    while (cumulated := cumulated + binomial(successes + 1, trials, share)) < TAIL:
        successes += 1
    return successes


def failing(trials, too_small):
    """The probability that the test of the uncertainty fails if sigmas are too small by a factor."""
    one, two = (math.erf(sigmas / too_small / math.sqrt(2)) for sigmas in (1, 2))
    passing = 0.0
    for within_two in range(most_that_fail(trials, TWO_SIGMA) + 1, trials + 1):
        for within_one in range(most_that_fail(trials, ONE_SIGMA) + 1, within_two + 1):
            passing += binomial(within_two, trials, two) * binomial(within_one, within_two, one / two)
    return 1 - passing


def student_t(freedom):
    """The quantile of Student's t beyond which TAIL lies."""
    scale = math.gamma((freedom + 1) / 2) / math.sqrt(freedom * math.pi) / math.gamma(freedom / 2)

    def within(t, steps=20000):  # from 0 to t, by Simpson's rule
        density = [scale * (1 + (t * n / steps)**2 / freedom)**(-(freedom + 1) / 2) for n in range(steps + 1)]
        return t / steps / 3 * (density[0] + density[-1] + 4 * sum(density[1:-1:2]) + 2 * sum(density[2:-1:2]))

    low, high = 0.0, 100.0
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if within(middle, 2000) < 0.5 - TAIL else (low, middle)
    return low


def uncertainty():
    columns = ["errors", "fails if so many or fewer lie within one sigma", "or within two sigma",
               "fails with right sigmas", "with sigmas too small by a factor of 1.5", "of 2", "of 3"]
    return table(columns, [[str(trials), str(most_that_fail(trials, ONE_SIGMA)), str(most_that_fail(trials, TWO_SIGMA)),
                            *(f"{100 * failing(trials, factor):.0f} %" for factor in (1, 1.5, 2, 3))]
                           for trials in (6, 12, 30, 60)])


def errors():
    rows = []
    for count in (3, 5, 10, 20):
        half = student_t(count - 1) / math.sqrt(count)
        rows.append([str(count), f"+/- {half:.1f} SD", f"+/- {half * math.sqrt(count + 1):.1f} SD",
                     f"{100 * (1 - 0.05**(1 / count)):.0f} %"])
    return table(["n", "interval of the bias, known positions", "known moves", "errors beyond the limit, up to"], rows)


TABLES = [("What is known of the phantom", "| given | what is compared |"),
          ("What few sessions prove", uncertainty),
          ("What few sessions prove", errors),
          ("What the reports of the AAPM ask besides", "| report | not tested |")]
