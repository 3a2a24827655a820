// A pendulum in C++ by the classical Runge-Kutta method on the underlying equation:
//     sysdyn compile models/seed/pendulum.sd --scene reference --index 0 -o pendulum
//     cc -c -I pendulum pendulum/residual.c pendulum/binding.c
//     c++ -I pendulum models/embedding/runge_kutta.cpp residual.o binding.o -lm
#include "sysdyn_model.h"

#include <cstdio>
#include <stdexcept>
#include <vector>

using vector = std::vector<double>;

static vector slopes(double t, const vector &y, const vector &p)
{
    vector zero(y.size()), r(y.size()); // index form 0: r = yd - F(t, y)
    if (sd_residual(t, y.data(), zero.data(), p.data(), r.data()))
        throw std::runtime_error("no slopes here");
    for (double &x : r)
        x = -x;
    return r;
}

static vector moved(vector y, double h, const vector &k)
{
    for (std::size_t i = 0; i < y.size(); i++)
        y[i] += h * k[i];
    return y;
}

int main()
{
    vector p(sd_p0, sd_p0 + sd_n_parameters), y(sd_n_unknowns), yd(sd_n_unknowns), w(sd_n_outputs);
    p[1] = 1.2; // l in m: "place" of binding.json
    if (sd_follow(p.data()) || sd_start(p.data(), y.data(), yd.data()))
        return 1;
    const int steps = 4000;
    const double h = 4.0 / steps;
    for (int n = 0; n < steps; n++) {
        const double t = sd_t0 + n * h;
        const vector a = slopes(t, y, p), b = slopes(t + h / 2, moved(y, h / 2, a), p);
        const vector c = slopes(t + h / 2, moved(y, h / 2, b), p), d = slopes(t + h, moved(y, h, c), p);
        y = moved(moved(moved(moved(y, h / 6, a), h / 3, b), h / 3, c), h / 6, d);
    }
    if (sd_outputs(4.0, y.data(), slopes(4.0, y, p).data(), p.data(), w.data()))
        return 1;
    std::printf("%.9f %.9f\n", w[0], w[1]); // q1 and q2 in m
}
