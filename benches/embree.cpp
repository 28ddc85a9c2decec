// Rays per second of Embree's single-ray calls, beside which benches/rays.rs puts our own.
// usage: embree TRIANGLES RAYS any|nearest THREADS REPEATS
//   TRIANGLES: 9 floats each. RAYS: origin, t_max, direction, unused: 8 floats each; a negative t_max is no ray.
// Prints: hits, seconds of the whole process's CPU time per repeat (the least), the same of wall time.
#include <embree3/rtcore.h>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <thread>
#include <vector>

static std::vector<float> read(const char* path) {
    FILE* file = fopen(path, "rb");
    if (!file) { fprintf(stderr, "cannot read %s\n", path); exit(1); }
    fseek(file, 0, SEEK_END);
    std::vector<float> data(ftell(file) / sizeof(float));
    rewind(file);
    if (fread(data.data(), sizeof(float), data.size(), file) != data.size()) exit(1);
    fclose(file);
    return data;
}

static double seconds(clockid_t clock) {
    timespec t;
    clock_gettime(clock, &t);
    return t.tv_sec + t.tv_nsec * 1e-9;
}

int main(int argc, char** argv) {
    if (argc != 6) return 2;
    std::vector<float> triangles = read(argv[1]), rays = read(argv[2]);
    bool any = !strcmp(argv[3], "any");
    size_t threads = atoi(argv[4]), repeats = atoi(argv[5]), count = rays.size() / 8;
    RTCDevice device = rtcNewDevice(nullptr);
    RTCScene scene = rtcNewScene(device);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    size_t n = triangles.size() / 9;
    float* v = (float*)rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, n * 3);
    unsigned* i = (unsigned*)rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, n);
    memcpy(v, triangles.data(), n * 36);
    for (size_t k = 0; k < n * 3; k++) i[k] = k;
    rtcCommitGeometry(mesh);
    rtcAttachGeometry(scene, mesh);
    rtcCommitScene(scene);
    double best_cpu = 1e30, best_wall = 1e30;
    std::vector<size_t> hits(threads);
    for (size_t r = 0; r < repeats; r++) {
        double cpu = seconds(CLOCK_PROCESS_CPUTIME_ID), wall = seconds(CLOCK_MONOTONIC);
        auto work = [&](size_t thread) {
            RTCIntersectContext context;
            rtcInitIntersectContext(&context);
            size_t found = 0;
            // Blocks in turn, so that the threads end together.
            for (size_t block = thread; block * 1024 < count; block += threads) {
                for (size_t k = block * 1024; k < count && k < (block + 1) * 1024; k++) {
                    const float* s = &rays[k * 8];
                    if (s[3] < 0) continue;
                    RTCRayHit q{};
                    q.ray.org_x = s[0]; q.ray.org_y = s[1]; q.ray.org_z = s[2]; q.ray.tfar = s[3];
                    q.ray.dir_x = s[4]; q.ray.dir_y = s[5]; q.ray.dir_z = s[6]; q.ray.mask = -1;
                    q.hit.geomID = RTC_INVALID_GEOMETRY_ID;
                    if (any) rtcOccluded1(scene, &context, &q.ray);
                    else rtcIntersect1(scene, &context, &q);
                    found += any ? q.ray.tfar < 0 : q.hit.geomID != RTC_INVALID_GEOMETRY_ID;
                }
            }
            hits[thread] = found;
        };
        std::vector<std::thread> pool;
        for (size_t t = 1; t < threads; t++) pool.emplace_back(work, t);
        work(0);
        for (auto& t : pool) t.join();
        cpu = seconds(CLOCK_PROCESS_CPUTIME_ID) - cpu;
        wall = seconds(CLOCK_MONOTONIC) - wall;
        if (cpu < best_cpu) best_cpu = cpu;
        if (wall < best_wall) best_wall = wall;
    }
    size_t all = 0;
    for (size_t h : hits) all += h;
    printf("%zu %.6f %.6f\n", all, best_cpu, best_wall);
}
