// Exclusive prefix sum over a workgroup of 256 threads, for any subgroup size. Sums saturate instead of wrapping.
#define_import_path gs4d::scan

// 16 groups of 16, padded so that groups start in different banks.
var<workgroup> scan_values: array<u32, 272>;
// The sums of the groups; the last element is the total.
var<workgroup> scan_groups: array<u32, 17>;

fn saturating_add(a: u32, b: u32) -> u32 {
    return select(a + b, 0xffffffffu, a + b < a);
}

// Returns the sum of the values of all threads before this one. Every thread of the workgroup must call this function.
// It starts with a barrier, so that it can be called repeatedly.
fn exclusive_scan(value: u32, thread: u32) -> u32 {
    let slot = thread + thread / 16u;
    workgroupBarrier();
    scan_values[slot] = value;
    workgroupBarrier();
    if thread < 16u {
        var sum = 0u;
        for (var i = 0u; i < 16u; i++) {
            let at = thread * 17u + i;
            let item = scan_values[at];
            scan_values[at] = sum;
            sum = saturating_add(sum, item);
        }
        scan_groups[thread] = sum;
    }
    workgroupBarrier();
    if thread == 0u {
        var sum = 0u;
        for (var i = 0u; i < 16u; i++) {
            let item = scan_groups[i];
            scan_groups[i] = sum;
            sum = saturating_add(sum, item);
        }
        scan_groups[16] = sum;
    }
    workgroupBarrier();
    return saturating_add(scan_groups[thread / 16u], scan_values[slot]);
}

// Returns the sum over the workgroup of the last scan.
fn scan_total() -> u32 {
    return scan_groups[16];
}
