"""The C++ of shape functions: where a subset's pixels lie, and how warps compose.

A warp's twelve numbers are those of `dic.correlation.warp.NAMES`. It is composed as a jet: value, first and
second derivatives at the centre of the subset. For affine warps this is exact; for quadratic ones it leaves
out third and fourth order, as the shape function itself does.
"""

JETS = """
    struct jet {
        // Place relative to the material point, and the gradient F (I included), at an offset.
        static inline void at(const double* w, double x, double y, double* place, double* F) {
            F[0] = 1.0 + w[2] + w[6] * x + w[7] * y;
            F[1] = w[3] + w[7] * x + w[8] * y;
            F[2] = w[4] + w[9] * x + w[10] * y;
            F[3] = 1.0 + w[5] + w[10] * x + w[11] * y;
            place[0] = x + w[0] + w[2] * x + w[3] * y + 0.5 * w[6] * x * x + w[7] * x * y
                + 0.5 * w[8] * y * y;
            place[1] = y + w[1] + w[4] * x + w[5] * y + 0.5 * w[9] * x * x + w[10] * x * y
                + 0.5 * w[11] * y * y;
        }
        static inline bool inverse(const double* F, double* A) {
            const double det = F[0] * F[3] - F[1] * F[2];
            if (!(det > 0.0)) return false;
            const double one = 1.0 / det;
            A[0] = F[3] * one; A[1] = -F[1] * one; A[2] = -F[2] * one; A[3] = F[0] * one;
            return true;
        }
        // w <- w o d^-1, to second order at the centre; false if one of them folds.
        static inline bool update(double* w, const double* d) {
            double x = 0.0, y = 0.0, e[2], F[4], A[4];
            for (int k = 0; k < 4; ++k) {  // Newton: the offset that d carries to the centre
                at(d, x, y, e, F);
                if (!inverse(F, A)) return false;
                x -= A[0] * e[0] + A[1] * e[1];
                y -= A[2] * e[0] + A[3] * e[1];
            }
            at(d, x, y, e, F);
            if (!inverse(F, A)) return false;
            double place[2], P[4], bent[2][3], back[2][3];
            at(w, x, y, place, P);
            for (int c = 0; c < 2; ++c) {
                pull(d + 6 + 3 * c, A, bent[c]);
                pull(w + 6 + 3 * c, A, back[c]);
            }
            for (int k = 0; k < 3; ++k) {  // second derivatives of d^-1 are -A times those of d, pulled back
                const double first = A[0] * bent[0][k] + A[1] * bent[1][k];
                const double second = A[2] * bent[0][k] + A[3] * bent[1][k];
                w[6 + k] = back[0][k] - P[0] * first - P[1] * second;
                w[9 + k] = back[1][k] - P[2] * first - P[3] * second;
            }
            w[0] = place[0];
            w[1] = place[1];
            w[2] = P[0] * A[0] + P[1] * A[2] - 1.0;
            w[3] = P[0] * A[1] + P[1] * A[3];
            w[4] = P[2] * A[0] + P[3] * A[2];
            w[5] = P[2] * A[1] + P[3] * A[3] - 1.0;
            return true;
        }
        // A' Q A of a symmetric form (xx, xy, yy)
        static inline void pull(const double* Q, const double* A, double* out) {
            const double a = Q[0] * A[0] + Q[1] * A[2], b = Q[0] * A[1] + Q[1] * A[3];
            const double c = Q[1] * A[0] + Q[2] * A[2], d = Q[1] * A[1] + Q[2] * A[3];
            out[0] = A[0] * a + A[2] * c;
            out[1] = A[0] * b + A[2] * d;
            out[2] = A[1] * b + A[3] * d;
        }
        // Half the width and height of the box about the centre that holds the subset's image.
        static inline void box(const double* w, double h, double* half) {
            for (int c = 0; c < 2; ++c) {
                const double* g = w + 2 + 2 * c;
                const double* q = w + 6 + 3 * c;
                half[c] = h * (fabs(g[0] + (c == 0)) + fabs(g[1] + (c == 1)))
                    + h * h * (0.5 * fabs(q[0]) + fabs(q[1]) + 0.5 * fabs(q[2]));
            }
        }
        // How far d moves the corner of the subset that it moves most.
        static inline double farthest(const double* d, double h) {
            double most = 0.0;
            for (int k = 0; k < 4; ++k) {
                const double x = (k & 1) ? h : -h, y = (k & 2) ? h : -h;
                double place[2], F[4];
                at(d, x, y, place, F);
                const double far = sqrt((place[0] - x) * (place[0] - x) + (place[1] - y) * (place[1] - y));
                if (!(far <= most)) most = far;
            }
            return most;
        }
    };
"""
