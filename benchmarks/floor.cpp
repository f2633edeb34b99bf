// The floor of a contact sweep: the two-stage exponential step of jaxrotor, by hand.
//
//     s_0 = look_0 w + steady(theta),                 f_0 = forces(s_0)
//     s_1 = look_1 w + steady(theta + h) + echo f_0,  f_1 = forces(s_1)
//     w  <- exp(h lambda) w + feed (f_0, f_1)
//
// w: amplitudes of MODES complex modes, deviation from the steady response; s: displacement and
// velocity of one station; f: force of STOPS sharp stops there. Lanes go WIDTH at a time, a lane an
// element of a vector; all real; coefficients are shared by the lanes, the steady response is not.
//
//     c++ -O3 -march=native -shared -fPIC -pthread -DMODES=16 -DSTOPS=3 floor.cpp -o floor.so

#include <cmath>
#include <cstring>
#include <thread>
#include <vector>

#ifndef WIDTH
#define WIDTH 8
#endif

typedef double Lanes __attribute__((vector_size(WIDTH * sizeof(double))));

namespace {

constexpr int STATE = 2 * MODES;  // [re, im]

struct Stop { double cos, sin, gap, stiffness, damping, friction; };

struct Tableau {
    const double (*look)[4][STATE];  // at the start and at the end of a step
    const double (*echo)[2];         // [4][2]
    const double (*feed)[4];         // [STATE][4]
    const double* turn;              // re, im of exp(h lambda)
    const Stop* stops;
    double rim;                      // [m/s]
};

// Force (x, y) from seen = (x, vx, y, vy).
inline void forces(const Tableau& t, const Lanes seen[4], Lanes force[2]) {
    const Lanes zero = {};
    force[0] = force[1] = zero;
    for (int k = 0; k < STOPS; ++k) {
        const Stop& stop = t.stops[k];
        const Lanes depth = stop.cos * seen[0] + stop.sin * seen[2] - stop.gap;
        const Lanes closing = stop.cos * seen[1] + stop.sin * seen[3];
        const Lanes slip = t.rim + stop.cos * seen[3] - stop.sin * seen[1];
        Lanes normal = stop.stiffness * depth + stop.damping * closing;
        normal = (depth > 0.0) & (normal > 0.0) ? normal : zero;
        const Lanes rub = slip > 0.0 ? stop.friction * normal
                                     : (slip < 0.0 ? -stop.friction * normal : zero);
        force[0] += stop.sin * rub - stop.cos * normal;
        force[1] -= stop.cos * rub + stop.sin * normal;
    }
}

void block(const Tableau& t, Lanes* state, const Lanes* cos4, const Lanes* sin4,
           const double* phases, long revolutions, long steps) {
    Lanes w[STATE], s[2][4], f[4];
    std::memcpy(w, state, sizeof w);
    for (long turn = 0; turn < revolutions; ++turn)
        for (long step = 0; step < steps; ++step) {
            for (int c = 0; c < 2; ++c) {
                const double cosine = phases[2 * (step + c)], sine = phases[2 * (step + c) + 1];
                for (int i = 0; i < 4; ++i) s[c][i] = cosine * cos4[i] + sine * sin4[i];
            }
#pragma GCC unroll 4
            for (int j = 0; j < STATE; ++j) {
                s[0][0] += t.look[0][0][j] * w[j];
                s[0][1] += t.look[0][1][j] * w[j];
                s[0][2] += t.look[0][2][j] * w[j];
                s[0][3] += t.look[0][3][j] * w[j];
                s[1][0] += t.look[1][0][j] * w[j];
                s[1][1] += t.look[1][1][j] * w[j];
                s[1][2] += t.look[1][2][j] * w[j];
                s[1][3] += t.look[1][3][j] * w[j];
            }
            forces(t, s[0], f);
            for (int i = 0; i < 4; ++i) s[1][i] += t.echo[i][0] * f[0] + t.echo[i][1] * f[1];
            forces(t, s[1], f + 2);
#pragma GCC unroll 4
            for (int j = 0; j < MODES; ++j) {
                const double re = t.turn[j], im = t.turn[MODES + j];
                const double *a = t.feed[j], *b = t.feed[MODES + j];
                const Lanes u = w[j], v = w[MODES + j];
                w[j] = re * u - im * v + a[0] * f[0] + a[1] * f[1] + a[2] * f[2] + a[3] * f[3];
                w[MODES + j] = re * v + im * u + b[0] * f[0] + b[1] * f[1] + b[2] * f[2] + b[3] * f[3];
            }
        }
    std::memcpy(state, w, sizeof w);
}

}  // namespace

// state: (blocks, STATE, WIDTH), turned in place; cos4, sin4: (blocks, 4, WIDTH), the steady response;
// phases: (steps + 1, 2), cos and sin of the revolution angle. All aligned to a vector.
extern "C" void march(double* state, const double* cos4, const double* sin4, const double* look,
                      const double* echo, const double* feed, const double* turn,
                      const double* stops, double rim, const double* phases, long blocks,
                      long revolutions, long steps, long threads) {
    const Tableau t = {reinterpret_cast<const double (*)[4][STATE]>(look),
                       reinterpret_cast<const double (*)[2]>(echo),
                       reinterpret_cast<const double (*)[4]>(feed), turn,
                       reinterpret_cast<const Stop*>(stops), rim};
    auto share = [&](long first) {
        for (long b = first; b < blocks; b += threads)
            block(t, reinterpret_cast<Lanes*>(state) + b * STATE,
                  reinterpret_cast<const Lanes*>(cos4) + b * 4,
                  reinterpret_cast<const Lanes*>(sin4) + b * 4, phases, revolutions, steps);
    };
    std::vector<std::thread> pool;
    for (long i = 1; i < threads; ++i) pool.emplace_back(share, i);
    share(0);
    for (auto& one : pool) one.join();
}
