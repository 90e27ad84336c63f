"""The C++ of the search: inverse-compositional Gauss-Newton from a guess to an outcome."""

from dic.correlation.kernels.lanes import BLOCK, PACKS
from dic.correlation.kernels.pixel_noise import GRAIN
from dic.correlation.kernels.shape_functions import JETS
from dic.correlation.kernels.spline import SPLINE
from dic.correlation.kernels.subset import SUBSET
from dic.outcome import PointOutcome

ARRAYS = 5
"""Arrays of a subset's pixels that a search keeps in its scratch."""
FOUND = 19
"""Numbers that are written for a point: warp, covariance, correlation, updates, outcome. As in what is read,
each for all points in a row: what a caller gets is then a piece of that memory, and no copy of it."""
GIVEN = 29
"""Numbers that are read of a point at most: pictures and place (3), place in the picture (2), two warps."""
PACE = 6
"""Updates over which the pace of a search is judged: one that cannot end in time is not continued."""

_SEARCH = """
    const double h = 0.5 * (job.subset - 1);
    const long long all = job.points;
    const int square = job.subset * job.subset, room = job.room;
    float* W = (float*)job.scratch + (long long)slot * ARRAYS * room;
    const float* X = (const float*)job.offsets;
    const float* Y = X + room;
    const float* U = Y + room;  // 1 for a pixel of the subset, 0 for what fills the last pack
    const int start = STEP == 32 ? lane : 0;
    SHARED(normal, N);

    for (int i = first + slot; i < first + count; i += slots) {
        const double* given = (const double*)job.given;  // a column after the other
        const double cx = given[3 * all + 2LL * i], cy = given[3 * all + 2LL * i + 1];
        double w[12], reference[12];
        for (int k = 0; k < 12; ++k) {
            w[k] = given[5 * all + 12LL * i + k];
            reference[k] = job.has_reference ? given[17 * all + 12LL * i + k] : 0.0;
        }
        const long long a = (long long)given[i], b = (long long)given[all + i];  // which pictures
        // The template, in memory that lasts if its point has some: B is W where the whole subset is in view.
        const long long place = job.has_kept ? (long long)given[2 * all + i] : -1;
        const bool ready = place >= 0 && ((int*)job.known)[place];
        float* T = place >= 0 ? (float*)job.kept_pixels + place * 4 * room : W + room;
        float* GX = T + room; float* GY = GX + room; float* B = GY + room;
        const float* origin_f = ((const float* const*)job.f)[a] + job.f_first;
        const float* origin_g = ((const float* const*)job.g)[b] + job.g_first;
        const view f = {origin_f, job.f_rows, job.f_cols, job.f_stride};
        const view g = {origin_g, job.g_rows, job.g_cols, job.g_stride};
        const double* grey_f = (const double*)job.f_noise + 2 * a;  // variance in the dark, gain
        const double* grey_g = (const double*)job.g_noise + 2 * b;
        const material body = {(const unsigned char*)job.mask, job.mask_rows, job.mask_cols, cx, cy, h};
        int outcome = NOT_CONVERGED, iterations = 0;
        double zncc = 0.0, covariance[3] = {0.0, 0.0, 0.0}, odd = 0.0;
        for (int k = 0; k < 12; ++k) odd += w[k] * 0.0 + reference[k] * 0.0;  // NaN if one is not finite
        double here[2], F0[4], F1[4], A[4], step[12];
        places from, to;

        from.set(f, cx, cy, reference, h);
        jet::at(reference, 0.0, 0.0, here, F0);
        if (odd != 0.0) {
            outcome = NO_FIRST_GUESS;
        } else if (!from.sane || !jet::inverse(F0, A)) {
            outcome = OUT_OF_VIEW;
        } else if (to.set(g, cx, cy, w, h), to.sane && !to.within
                   && to.seen(X, Y, U, room, start) < job.least_pixels * square) {
            outcome = OUT_OF_VIEW;  // as it would be found after the template's work
        } else {
            double level = 0.0, between_f = 0.0, drift[K];
            bool enough = true;
            monomials at;
            if (ready) {
                const double* kept = (double*)job.kept_sums + place * SUMS;
                N.load(kept);
                level = kept[SUMS - K - 2]; between_f = kept[SUMS - K - 1];
                for (int j = 0; j < K; ++j) drift[j] = kept[SUMS - K + j];
                for (int k = start; k < room; k += STEP) op::store(W + k, op::load(B + k));
            } else {
                // The template and its gradient by the offset in the subset.
                pack counted = op::all(0.0f), total = counted, grit = counted, tilt[K];
                for (int j = 0; j < K; ++j) tilt[j] = op::all(0.0f);
                #pragma unroll 1
                for (int k = start; k < room; k += STEP) {
                    const pack x = op::load(X + k), y = op::load(Y + k);
                    pack u = op::load(U + k), px, py, gx, gy;
                    if (job.has_mask) u = u * body.at(x, y);
                    from.of(x, y, &px, &py);
                    if (!from.within) u = u * from.held(&px, &py);
                    const pack t = spline::slope(from.origin, from.stride, px, py, &gx, &gy);
                    from.turn(x, y, &gx, &gy);
                    op::store(W + k, u); op::store(B + k, u); op::store(T + k, t);
                    op::store(GX + k, gx); op::store(GY + k, gy);
                    counted += u; total += u * t;
                    pack dx, dy;
                    grit += u * grain::drift(&job.spread[0], &job.slope[0], px, py, &dx, &dy);
                    from.turn(x, y, &dx, &dy);
                    at.set(x, y);
                    for (int j = 0; j < ORDER; ++j) {
                        tilt[j] += u * dx * at.m[j];
                        tilt[ORDER + j] += u * dy * at.m[j];
                    }
                }
                const double n = op::sum(counted);
                enough = n >= job.least_pixels * square;
                if (enough) {
                    const float mean = (float)(op::sum(total) / n);  // sums of small numbers
                    #pragma unroll 1
                    for (int k = start; k < room; k += STEP) op::store(T + k, op::load(T + k) - mean);
                    N.sum(W, T, GX, GY, X, Y, room, start);
                    level = mean;
                    for (int j = 0; j < K; ++j) drift[j] = op::sum(tilt[j]);
                    between_f = op::sum(grit) / n;
                    if (place >= 0) {
                        double* kept = (double*)job.kept_sums + place * SUMS;
                        N.save(kept);
                        kept[SUMS - K - 2] = level; kept[SUMS - K - 1] = between_f;
                        for (int j = 0; j < K; ++j) kept[SUMS - K + j] = drift[j];
                        ((int*)job.known)[place] = 1;
                    }
                }
            }
            if (!enough) {
                outcome = OUT_OF_VIEW;
            } else {
                bool whole = true;  // N holds the whole template
                double offset = level, contrast = 1.0, brightness = level;
                double noise_f = 0.0, noise_g = 0.0, share = 0.0;
                double least = 1e30, earlier[PACE];  // smallest update so far, now and up to PACE ago
                for (int k = 0; k < PACE; ++k) earlier[k] = 1e30;
                while (true) {
                    // Gradients must hold more of the pattern than of the reference's noise.
                    noise_f = grey_f[0] + grey_f[1] * op::positive(N.mean + level);
                    const double added = job.grit * noise_f * N.n;
                    const double xx = N.gradient[0] - 2.0 * added * (F0[0] * F0[0] + F0[2] * F0[2]);
                    const double xy = N.gradient[1] - 2.0 * added * (F0[0] * F0[1] + F0[2] * F0[3]);
                    const double yy = N.gradient[2] - 2.0 * added * (F0[1] * F0[1] + F0[3] * F0[3]);
                    if (!N.definite || !(xx > 0.0 && xx * yy > xy * xy)) { outcome = LOW_CONTRAST; break; }
                    share = added * (F0[0] * F0[0] + F0[1] * F0[1] + F0[2] * F0[2] + F0[3] * F0[3])
                        / (N.gradient[0] + N.gradient[2]);
                    to.set(g, cx, cy, w, h);
                    jet::at(w, 0.0, 0.0, here, F1);
                    if (!to.sane) { outcome = OUT_OF_VIEW; break; }
                    if (!jet::inverse(F1, A)) { outcome = NOT_CONVERGED; break; }
                    if (!to.within || !whole) {
                        // Pixels that left the picture do not count, those that came back do.
                        pack left = op::all(0.0f), changed = left;
                        #pragma unroll 1
                        for (int k = start; k < room; k += STEP) {
                            const pack before = op::load(W + k);
                            pack px, py;
                            to.of(op::load(X + k), op::load(Y + k), &px, &py);
                            const pack u = op::load(B + k) * to.held(&px, &py);
                            op::store(W + k, u);
                            left += u;
                            changed += (u - before) * (u - before);
                        }
                        if (op::sum(left) < job.least_pixels * square) { outcome = OUT_OF_VIEW; break; }
                        if (op::sum(changed) > 0.0) N.sum(W, T, GX, GY, X, Y, room, start);
                        whole = to.within;
                        if (!N.definite) { outcome = LOW_CONTRAST; break; }
                    }
                    pack g1 = op::all(0.0f), g2 = g1, tg = g1, s[K];
                    for (int j = 0; j < K; ++j) s[j] = op::all(0.0f);
                    const float zero = (float)offset;
                    #pragma unroll 1
                    for (int k = start; k < room; k += STEP) {
                        const pack x = op::load(X + k), y = op::load(Y + k);
                        pack px, py;
                        to.of(x, y, &px, &py);
                        if (!to.within) to.held(&px, &py);
                        const pack v = spline::value(to.origin, to.stride, px, py) - zero;
                        const pack wv = v * op::load(W + k);
                        g1 += wv; g2 += wv * v; tg += wv * op::load(T + k);
                        const pack ax = wv * op::load(GX + k), ay = wv * op::load(GY + k);
                        at.set(x, y);
                        for (int j = 0; j < ORDER; ++j) {
                            s[j] += ax * at.m[j];
                            s[ORDER + j] += ay * at.m[j];
                        }
                    }
                    const double sum = op::sum(g1), mean = sum / N.n;
                    const double energy = op::sum(g2) - mean * sum, cross = op::sum(tg) - N.mean * sum;
                    brightness = mean + zero;
                    noise_g = grey_g[0] + grey_g[1] * op::positive(brightness);
                    // Little more than noise, or than what fp32 leaves of a grey value.
                    if (!(energy > N.n * (1.5 * job.between * noise_g + 1e-10 * brightness * brightness))) {
                        outcome = LOW_CONTRAST;
                        break;
                    }
                    zncc = cross / sqrt(energy * N.energy);
                    contrast = sqrt(energy / N.energy);
                    offset = brightness;
                    if (iterations == job.max_iterations) { outcome = NOT_CONVERGED; break; }
                    double d[K];
                    const double slope = cross / N.energy;
                    for (int j = 0; j < K; ++j)
                        d[j] = (op::sum(s[j]) - mean * N.S[j] - slope * N.q[j]) / contrast
                            + noise_f * drift[j];
                    N.solve(d);
                    for (int k = 0; k < 12; ++k) step[k] = 0.0;
                    step[0] = d[0]; step[1] = d[ORDER];
                    if (ORDER > 1) {
                        step[2] = d[1 % K] / h; step[3] = d[2 % K] / h;
                        step[4] = d[(ORDER + 1) % K] / h; step[5] = d[(ORDER + 2) % K] / h;
                    }
                    if (ORDER > 3)
                        for (int k = 0; k < 3; ++k) {
                            step[6 + k] = d[(3 + k) % K] / (h * h);
                            step[9 + k] = d[(ORDER + 3 + k) % K] / (h * h);
                        }
                    ++iterations;
                    const double far = jet::farthest(step, h);
                    if (!(far < 1e3) || !jet::update(w, step)) { outcome = NOT_CONVERGED; break; }
                    const double ago = earlier[iterations % PACE];
                    if (far < least) least = far;
                    earlier[iterations % PACE] = least;
                    // At the pace of the last updates twice as many as are left would not do.
                    if (!(far < job.tolerance) && iterations > PACE
                        && wp::log(least / job.tolerance) * PACE
                            > 2.0 * (job.max_iterations - iterations) * wp::log(ago / least)) {
                        outcome = NOT_CONVERGED;
                        break;
                    }
                    if (far < job.tolerance) {
                        outcome = zncc < job.least_zncc ? LOW_CORRELATION : VALID;
                        double column[2][K];
                        for (int c = 0; c < 2; ++c) {
                            for (int j = 0; j < K; ++j) column[c][j] = j == c * ORDER ? 1.0 : 0.0;
                            N.solve(column[c]);
                        }
                        jet::at(w, 0.0, 0.0, here, F1);
                        const double spectrum[3] = {N.gradient[0] / N.energy, N.gradient[1] / N.energy,
                                                    N.gradient[2] / N.energy};
                        const double smooth = job.prefilter * job.prefilter;
                        const double kept = 1.0 - share;
                        const double likely = (1.0 + 2.0 * sqrt(2.0 / N.n))
                            * (noise_f * between_f + noise_g * job.between / (contrast * contrast));
                        // Where the residual is larger than noise and chance explain, so is the variance.
                        const double excess = (2.0 - 2.0 * zncc) * N.energy / N.n;
                        const double gain_f = grain::gain(F0, smooth, spectrum);
                        const double gain_g = grain::gain(F1, smooth, spectrum);
                        double variance = (noise_f * gain_f * kept + noise_g * gain_g / (contrast * contrast))
                            / (kept * kept);
                        if (!(likely > 0.0))  // none declared: the residual is all there is
                            variance = excess * (gain_f + gain_g) / (between_f + job.between);
                        else if (excess > likely) variance *= excess / likely;
                        const double xx = column[0][0] * variance, xy = column[0][ORDER] * variance;
                        const double yy = column[1][ORDER] * variance;
                        covariance[0] = F1[0] * (F1[0] * xx + F1[1] * xy) + F1[1] * (F1[0] * xy + F1[1] * yy);
                        covariance[1] = F1[2] * (F1[0] * xx + F1[1] * xy) + F1[3] * (F1[0] * xy + F1[1] * yy);
                        covariance[2] = F1[2] * (F1[2] * xx + F1[3] * xy) + F1[3] * (F1[2] * xy + F1[3] * yy);
                        break;
                    }
                }
            }
        }
        if (start == 0) {
            double* found = (double*)job.found;
            for (int k = 0; k < 12; ++k) found[12LL * i + k] = w[k];
            for (int k = 0; k < 4; ++k) found[12 * all + 4LL * i + k] = covariance[(k + 1) / 2];
            found[16 * all + i] = zncc;
            found[17 * all + i] = iterations;
            found[18 * all + i] = outcome;
        }
    }
"""


def search_source(parameters: int) -> str:
    """The body of the native function for a shape function of so many parameters."""
    text = f"    constexpr int WARPS = {BLOCK // 32}, ARRAYS = {ARRAYS}, PACE = {PACE};\n"
    text += f"    constexpr int ORDER = {parameters // 2};  // monomials of a displacement component\n"
    for outcome in PointOutcome:
        text += f"    constexpr int {outcome.name} = {outcome.value};\n"
    return text + PACKS + JETS + SPLINE + GRAIN + SUBSET + _SEARCH
