!> Convolutions over a window of the lattice by FFT.
!>
!> A product takes three stages, each cut into independent 1-D transforms, so that the
!> result does not depend on the number of threads: transforms along the rows of the window
!> (padding rows are never touched), two real rows as the two parts of a complex one;
!> transforms along the columns in blocks that stay in cache, there multiplication with the
!> spectra and transforms back at once; transforms of the rows back. The way back is the
!> forward transform of the conjugate, so that two plans are enough.
!>
!> Every kernel is even or odd, so that its spectrum is real, or i times real.
!>
!> Several ranks share the rows of the fields and, between two transposes, the blocks of columns with their spectra. Each transform
!> is the same as on one rank.
!>
!> Equations: docs/theory/discretisation.md, (D4).
module hc_convolution
  use, intrinsic :: iso_c_binding, only: c_ptr, c_null_ptr, c_associated, c_intptr_t, c_loc, c_int, c_f_pointer
  use, intrinsic :: iso_fortran_env, only: int8, int64, real32, real64
  use hc_precision, only: wp
  use hc_build_options, only: perturb_convolution
  use hc_error, only: error_t, status, raise
  use hc_communicator, only: communicator_t, block_layout_t
  use hc_field_space, only: field_space_t
  use hc_fftw, only: fftw_plan_many_dft, fftw_execute_dft, fftw_destroy_plan, fftw_forward, fftw_estimate
  use hc_lock, only: lock, unlock, fftw_planner
  use hc_scratch, only: scratch_t, release_scratch
  use hc_spectrum, only: kernel_spectrum_t, kernel_key_t, release
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_fft_layout, only: block_width, even
  use hc_fft_passes, only: pair_rows, split_rows, join_rows, gather_columns, scatter_columns, multiply, multiply_one
  !$ use omp_lib, only: omp_get_thread_num
  implicit none
  private

  public :: convolution_t, new_convolution, kernel_source_t

  !> Plans of FFTW with a count of their users, of whom the last one frees them.
  type :: plans_t
    type(c_ptr) :: row = c_null_ptr, column = c_null_ptr
    integer :: users = 1
  end type plans_t

  !> Plans, spectra and memory that convolutions share, each with a count of its users; a copy is one more.
  !>
  !> gfortran (12 to 14) copies allocatable components without the assignment below. Such a copy lies elsewhere than its
  !> `place`: it is no user, and frees nothing.
  type :: holdings_t
    integer(c_intptr_t) :: place = 0
    type(plans_t), pointer :: plans => null()
    type(kernel_spectrum_t), pointer :: spectrum => null()
    type(scratch_t), pointer :: scratch => null()
  contains
    procedure, private :: share
    generic :: assignment(=) => share
    final :: let_go
  end type holdings_t

  !> Plans, spectra and scratch space.
  type :: convolution_t
    !> Spectra (`frequencies`, block, kernel), normalised; those of odd kernels are divided by i. Convolutions may share them.
    real(wp), pointer, contiguous :: spectrum(:, :, :) => null()
    !> The spectra rounded to single precision, which stand for them if they are there
    real(real32), pointer, contiguous :: narrow(:, :, :) => null()
    !> Spectra are rounded: the convolution only serves for starts
    logical :: rounded = .false.
    !> Spectrum of a single even kernel in double precision, which stands for it if it is there; its owner outlives the convolution
    real(real64), pointer, contiguous :: wide(:, :) => null()
    !> Factor of the results
    real(wp) :: factor = 1.0_wp
    !> The kernel `complement` is this times the first one less the second one
    real(wp) :: whole = 0.0_wp
    !> Space of the fields
    type(field_space_t) :: space
    !> Ranks that share the transforms; rows before the first of this one where each holds all rows of the fields
    type(communicator_t), private :: ranks
    integer, private :: rows_before = 0
    !> Transform lengths along the two lattice directions
    integer :: padded(2) = 0
    !> Columns in a block, number of blocks of this rank, and columns before the first of them
    integer :: width = 0, n_block = 0, before = 0
    !> Number of columns and rows of the window, and of the rows of this rank
    integer, private :: extent(2) = 0, n_row = 0
    !> Number of frequencies along the first direction, and the leading dimensions for them: of all blocks, of those of this rank
    integer, private :: n_frequency = 0, leading = 0, own_leading = 0
    !> Number of kernels, the first odd one
    integer, private :: n_kernel = 0, first_odd = 0
    !> Numbers of the row transforms, and of all that lies in the scratch
    integer(int64), private :: n_rows = 0, n_work = 0
    type(holdings_t), private :: held
    !> Transforms of own rows (leading, n_row or one more, component), in memory that convolutions may share
    complex(wp), pointer, contiguous, private :: work(:, :, :) => null()
    !> Those of all rows in the columns of this rank, as vectors: on one rank the same memory
    complex(wp), pointer, contiguous, private :: lines(:, :) => null()
    !> Two padded rows before and after their transform, for each thread
    complex(wp), allocatable, private :: row_buffer(:, :, :)
    !> One column block of each component before and after its transform, for each thread; column by column
    complex(wp), allocatable, private :: block_buffer(:, :, :, :)
  contains
    !> Sums of weighted convolutions, and the same in the place of the fields
    procedure :: convolve, convolve_in_place
    !> Memory beside the row transforms, whose content is lost when another convolution uses the scratch
    procedure :: beside
    !> The memory of the row transforms itself, for fields that are transformed in their place
    procedure :: in_place
    !> Take spectra from a cache, and store them there
    procedure :: find_spectra, store_spectra
    !> Spectra of kernels given at the lattice offsets
    procedure :: transform_kernels
    !> Frequencies of the entries of a block of the spectra
    procedure :: frequencies
    !> The transforms of one scalar product and nothing else
    procedure :: time_transforms
  end type convolution_t

  !> Source of the kernels at lattice offsets.
  type, abstract :: kernel_source_t
  contains
    procedure(kernel_row), deferred :: row
  end type kernel_source_t

  abstract interface
    !> Evaluate all kernels at the offsets of j >= 0 rows and -n...n columns: k(kernel, n + 1 + column)
    pure subroutine kernel_row(self, j, k)
      import :: kernel_source_t, wp
      class(kernel_source_t), intent(in) :: self
      integer, intent(in) :: j
      real(wp), intent(out) :: k(:, :)
    end subroutine kernel_row
  end interface

contains

  !> Make plans and scratch space for convolutions over a window; the spectra come next, by `find_spectra`.
  subroutine new_convolution(self, extent, padded, n_kernel, n_component, space, error, beside)
    !> Convolution to be set up
    type(convolution_t), intent(out) :: self
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Transform lengths, the first one a multiple of four; 2*extent - 1 at least unless the convolution is periodic
    integer, intent(in) :: padded(2)
    !> Numbers of even and of odd kernels, which follow, and of components of the fields
    integer, intent(in) :: n_kernel(2), n_component
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> Allocated on failure: not enough memory, a length FFTW cannot plan
    type(error_t), allocatable, intent(out) :: error
    !> Bytes of memory beside the row transforms; absent: none
    integer(int64), intent(in), optional :: beside
    integer(int64) :: bytes
    integer :: stat

    self%space = space
    self%n_kernel = sum(n_kernel)
    self%first_odd = n_kernel(1) + 1
    self%extent = extent
    self%padded = padded
    self%n_frequency = padded(1)/2 + 1
    self%width = block_width(padded(2))
    self%n_block = (self%n_frequency + self%width - 1)/self%width
    self%leading = self%n_block*self%width
    self%n_row = extent(2)
    self%ranks = space%ranks
    if (space%helpers%size > 1) self%ranks = space%helpers
    if (self%ranks%size > 1) then
      self%before = self%width*(self%ranks%first_item(self%n_block) - 1)
      self%n_block = self%ranks%last_item(self%n_block) - self%ranks%first_item(self%n_block) + 1
      self%n_row = self%ranks%last_row(extent(2)) - self%ranks%first_row(extent(2)) + 1
      if (space%helpers%size > 1) self%rows_before = self%ranks%first_row(extent(2)) - 1
    end if
    self%own_leading = self%n_block*self%width
    self%held%place = address(self%held)
    self%held%scratch => space%scratch
    if (.not. associated(self%held%scratch)) allocate (self%held%scratch)
    self%n_rows = int(self%leading, int64)*even(self%n_row)*n_component
    self%n_work = self%n_rows
    if (self%ranks%size > 1) self%n_work = self%n_work + int(self%own_leading, int64)*even(extent(2))*n_component
    bytes = self%n_work*(storage_size((1.0_wp, 0.0_wp))/8)
    if (present(beside)) bytes = bytes + beside
    call self%held%scratch%reserve(bytes, stat)
    if (stat == 0) allocate (self%row_buffer(padded(1), 2, space%threads), source=(0.0_wp, 0.0_wp), stat=stat)
    if (stat == 0) allocate (self%block_buffer(self%width*padded(2), n_component, 2, space%threads), source=(0.0_wp, 0.0_wp), &
                             stat=stat)
    if (stat /= 0) then
      call raise(error, status%resources, 'not enough memory for the transforms: use a smaller window')
    else
      call make_plans(self, error)
    end if
    call self%ranks%agree(error)
  end subroutine new_convolution

  !> Take the spectra from a cache, or allocate zero ones that are to be computed.
  subroutine find_spectra(self, found, error, cache, key)
    class(convolution_t), intent(inout) :: self
    !> The cache has them; they must not be changed
    logical, intent(out) :: found
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Cache of spectra
    type(kernel_cache_t), pointer, intent(in), optional :: cache
    !> With a cache: parameters of the kernels
    type(kernel_key_t), intent(in), optional :: key
    integer :: shape_wanted(3), stat

    shape_wanted = [self%width*self%padded(2), self%n_block, self%n_kernel]
    found = .false.
    call release(self%held%spectrum)
    if (is_kept(self, cache)) call cache%find(key, self%held%spectrum)
    if (associated(self%held%spectrum)) then
      if (self%rounded) then
        call self%held%spectrum%point(shape_wanted, self%narrow)
      else
        call self%held%spectrum%point(shape_wanted, self%spectrum)
      end if
      found = associated(self%spectrum) .or. associated(self%narrow)
      if (found) return
      call release(self%held%spectrum)
    end if
    allocate (self%held%spectrum)
    call self%held%spectrum%reserve(shape_wanted, self%spectrum, stat)
    if (stat /= 0) call raise(error, status%resources, 'not enough memory for the transforms: use a smaller window')
    call self%ranks%agree(error)
    if (.not. allocated(error)) self%spectrum = 0.0_wp
  end subroutine find_spectra

  !> Return whether a cache keeps the spectra: not the parts of several ranks.
  logical function is_kept(self, cache)
    class(convolution_t), intent(in) :: self
    !> The cache, if there is one
    type(kernel_cache_t), pointer, intent(in), optional :: cache

    is_kept = .false.
    if (present(cache)) is_kept = associated(cache) .and. self%ranks%size == 1
  end function is_kept

  !> Store complete spectra in the cache, rounded before if the convolution has rounded ones.
  subroutine store_spectra(self, cache, key)
    class(convolution_t), intent(inout) :: self
    !> The cache, if there is one
    type(kernel_cache_t), pointer, intent(in), optional :: cache
    !> With a cache: parameters of the kernels
    type(kernel_key_t), intent(in), optional :: key
    type(kernel_spectrum_t), pointer :: wide
    integer :: stat

    if (self%rounded) then
      wide => self%held%spectrum
      allocate (self%held%spectrum)
      call self%held%spectrum%reserve(shape(self%spectrum), self%narrow, stat)
      if (stat == 0) then
        self%narrow = real(self%spectrum, real32)
        self%spectrum => null()
        call release(wide)
      else
        call release(self%held%spectrum)
        self%held%spectrum => wide
        return
      end if
    end if
    if (is_kept(self, cache)) call cache%store(key, self%held%spectrum)
  end subroutine store_spectra

  !> Make the plans of the transforms.
  subroutine make_plans(self, error)
    class(convolution_t), intent(inout) :: self
    type(error_t), allocatable, intent(out) :: error
    integer(c_int) :: length(1), n1, width

    n1 = self%padded(1)
    width = self%width
    allocate (self%held%plans)
    ! FFTW_ESTIMATE: the same plan, and the same result, in every run
    call lock(fftw_planner)
    length = n1
    self%held%plans%row = &
      fftw_plan_many_dft(1_c_int, length, 1_c_int, self%row_buffer(:, 1, 1), length, 1_c_int, n1, &
                         self%row_buffer(:, 2, 1), length, 1_c_int, n1, fftw_forward, fftw_estimate)
    length = self%padded(2)
    self%held%plans%column = &
      fftw_plan_many_dft(1_c_int, length, width, self%block_buffer(:, 1, 1, 1), length, 1_c_int, length(1), &
                         self%block_buffer(:, 1, 2, 1), length, 1_c_int, length(1), fftw_forward, fftw_estimate)
    call unlock(fftw_planner)
    if (.not. (c_associated(self%held%plans%row) .and. c_associated(self%held%plans%column))) then
      call raise(error, status%resources, 'the transforms of this window cannot be planned; use another window')
    end if
  end subroutine make_plans

  !> Transform kernels that are given at the lattice offsets, for a padded convolution.
  !>
  !> A row of negative index is the reverse of its mirror image, up to the sign of an odd kernel, so that its transform is
  !> the conjugate: half of the kernel values and of the row transforms suffice.
  subroutine transform_kernels(self, source, error)
    class(convolution_t), intent(inout) :: self
    !> The kernels
    class(kernel_source_t), intent(in) :: source
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    complex(wp), allocatable, target :: rows(:, :, :), columns(:, :, :)
    real(wp), allocatable :: kernel(:, :, :)
    real(wp) :: scale
    integer :: n(2), n_kernel, first, j, m, thread, stat

    n = self%extent
    n_kernel = size(self%spectrum, 3)
    scale = 1.0_wp/(real(self%padded(1), wp)*real(self%padded(2), wp))
    first = self%ranks%first_row(n(2)) - 1
    allocate (rows(self%leading, first:first + even(self%n_row) - 1, n_kernel), stat=stat)
    if (stat == 0 .and. self%ranks%size > 1) allocate (columns(self%own_leading, even(n(2)), n_kernel), stat=stat)
    if (stat /= 0) call raise(error, status%resources, 'not enough memory for the spectra of the kernels: use a smaller window')
    call self%ranks%agree(error)
    if (allocated(error)) return

    thread = 1
    !$omp parallel num_threads(self%space%threads) private(j, m, kernel) firstprivate(thread)
    !$ thread = omp_get_thread_num() + 1
    allocate (kernel(n_kernel, 1 - n(1):n(1) - 1, 2))
    !$omp do schedule(dynamic)
    do j = first, first + self%n_row - 1, 2
      call source%row(j, kernel(:, :, 1))
      if (j + 1 < n(2)) then
        call source%row(j + 1, kernel(:, :, 2))
      else
        kernel(:, :, 2) = 0.0_wp                                               ! no values of another row
      end if
      do m = 1, n_kernel
        associate (given => self%row_buffer(:, 1, thread), transformed => self%row_buffer(:, 2, thread))
          given(:n(1)) = scale*cmplx(kernel(m, 0:, 1), kernel(m, 0:, 2), wp)
          given(n(1) + 1:) = 0.0_wp
          given(self%padded(1) - n(1) + 2:) = scale*cmplx(kernel(m, :-1, 1), kernel(m, :-1, 2), wp)
          call fftw_execute_dft(self%held%plans%row, given, transformed)
          call split_rows(transformed, rows(:self%n_frequency, j, m), rows(:self%n_frequency, j + 1, m))
        end associate
        rows(self%n_frequency + 1:, j:j + 1, m) = 0.0_wp
      end do
    end do
    !$omp end do
    !$omp end parallel
    if (self%ranks%size > 1) then
      call self%ranks%to_columns(layout_of(self, n_kernel), c_loc(rows), c_loc(columns))
      call move_alloc(columns, rows)
    end if
    call transform_kernel_columns(self, rows)
  end subroutine transform_kernels

  !> Transform the columns of kernels.
  subroutine transform_kernel_columns(self, rows)
    class(convolution_t), intent(inout) :: self
    !> Row transforms of the kernels, in the columns of this rank (own_leading, n_row or one more, kernel)
    complex(wp), intent(in) :: rows(self%own_leading, even(self%extent(2)), size(self%spectrum, 3))
    real(wp) :: sign
    integer :: n(2), m, b, column, thread, from

    n = self%extent
    thread = 1
    !$omp parallel num_threads(self%space%threads) private(m, b, column, sign, from) firstprivate(thread)
    !$ thread = omp_get_thread_num() + 1
    !$omp do schedule(dynamic)
    do b = 1, self%n_block
      from = (b - 1)*self%width + 1
      do m = 1, size(rows, 3)
        sign = merge(1.0_wp, -1.0_wp, m < self%first_odd)
        associate (given => self%block_buffer(:, 1, 1, thread), transformed => self%block_buffer(:, 1, 2, thread), &
                   length => self%padded(2))
          call gather_columns(self%width, n(2), self%own_leading, length, rows(from, 1, m), given)
          do column = 0, self%width - 1
            associate (line => given(column*length + 1:(column + 1)*length))
              line(length - n(2) + 2:) = sign*conjg(line(n(2):2:-1))
            end associate
          end do
          call fftw_execute_dft(self%held%plans%column, given, transformed)
          if (m < self%first_odd) then
            self%spectrum(:, b, m) = real(transformed, wp)
          else
            self%spectrum(:, b, m) = aimag(transformed)
          end if
        end associate
      end do
    end do
    !$omp end do
    !$omp end parallel
  end subroutine transform_kernel_columns

  !> Return how rows and columns lie in memory.
  type(block_layout_t) function layout_of(self, n_component) result(layout)
    class(convolution_t), intent(in) :: self
    !> Number of components
    integer, intent(in) :: n_component
    integer, parameter :: word = 32

    layout = block_layout_t(self%extent(2), n_component, self%leading/self%width, &
                            self%width*(storage_size((1.0_wp, 0.0_wp))/word), even(self%n_row), even(self%extent(2)))
  end function layout_of

  !> Return the indices of the frequencies of a block, f(1) = 0...padded(1)/2, f(2) = 0...padded(2)-1.
  pure function frequencies(self, b) result(f)
    class(convolution_t), intent(in) :: self
    !> Index of the block
    integer, intent(in) :: b
    !> Frequency indices (2, width*padded(2)); f(1) beyond padded(1)/2 is mere filling
    integer, allocatable :: f(:, :)
    integer :: column, row

    allocate (f(2, self%width*self%padded(2)))
    do column = 1, self%width
      do row = 1, self%padded(2)
        f(:, (column - 1)*self%padded(2) + row) = [self%before + (b - 1)*self%width + column - 1, row - 1]
      end do
    end do
  end function frequencies

  !> Compute result(:, :, o) = sum over i of kernel(o, i) * field(:, :, i)
  subroutine convolve(self, kernel, field, result)
    class(convolution_t), intent(inout) :: self
    !> Number of the kernel (onto, from), negative to reverse its sign, or `complement`
    integer, intent(in) :: kernel(:, :)
    !> Fields to be convolved (n_col, n_row, from)
    real(wp), intent(in), contiguous :: field(:, :, :)
    !> Sums of the convolutions (n_col, n_row, onto)
    real(wp), intent(out), contiguous :: result(:, :, :)

    call take_work(self, max(size(field, 3), size(result, 3)))
    call transform_fields(self, field)
    call multiply_columns(self, kernel)
    call transform_back(self, result)
  end subroutine convolve

  !> Replace fields by the sums of their convolutions.
  subroutine convolve_in_place(self, kernel, field)
    class(convolution_t), intent(inout) :: self
    !> Number of the kernel (onto, from), negative to reverse its sign, or `complement`; as many fields as sums
    integer, intent(in) :: kernel(:, :)
    !> Fields to be convolved; then their sums (n_col, n_row, from)
    real(wp), intent(inout), contiguous :: field(:, :, :)

    call take_work(self, size(field, 3))
    call transform_fields(self, field)
    call multiply_columns(self, kernel)
    call transform_back(self, field)
  end subroutine convolve_in_place

  !> Point to the memory of the row transforms.
  subroutine take_work(self, n_component)
    class(convolution_t), intent(inout) :: self
    !> Number of components
    integer, intent(in) :: n_component

    call c_f_pointer(self%held%scratch%place(), self%work, [self%leading, even(self%n_row), n_component])
    if (self%ranks%size > 1) then
      call c_f_pointer(self%held%scratch%place(self%n_rows*(storage_size((1.0_wp, 0.0_wp))/64)), self%lines, &
                       [self%own_leading*even(self%extent(2)), n_component])
    else
      self%lines(1:self%leading*even(self%extent(2)), 1:n_component) => self%work
    end if
  end subroutine take_work

  !> Return the address of the memory beside the row transforms.
  type(c_ptr) function beside(self)
    class(convolution_t), intent(in) :: self

    beside = self%held%scratch%place(self%n_work*(storage_size((1.0_wp, 0.0_wp))/64))
  end function beside

  !> Point to the memory of the row transforms, for fields of the window, or to nothing where no room is behind their transforms.
  !>
  !> Pairs of rows that are transformed from the last one on, and back from the first one on, never reach one still to be read.
  function in_place(self, n_component) result(field)
    class(convolution_t), intent(in) :: self
    !> Number of components
    integer, intent(in) :: n_component
    real(wp), pointer, contiguous :: field(:)

    field => null()
    if (self%ranks%size > 1 .or. self%leading < self%extent(1)) return
    if (int(self%leading, int64)*even(self%n_row)*n_component > self%n_rows) return
    call c_f_pointer(self%held%scratch%place(), field, [product(self%extent)*n_component])
  end function in_place

  !> Find the ends of the stages in which pairs of rows are transformed: one stage, but for fields in the memory of their
  !> transforms, where a stage begins so late that these lie behind all of its rows.
  subroutine find_stages(self, field, last)
    class(convolution_t), intent(in) :: self
    !> Fields (n_col, n_row, component)
    real(wp), intent(in), contiguous, target :: field(:, :, :)
    !> Pairs before the first stage, 0, and up to the end of each
    integer, allocatable, intent(out) :: last(:)
    integer :: end_of(storage_size(0) + 1), n

    n = 1
    end_of(1) = (self%n_row + 1)/2*size(field, 3)
    if (c_associated(c_loc(field), self%held%scratch%place())) then
      do while (end_of(n) > 1)
        end_of(n + 1) = (end_of(n) + 1)/2
        n = n + 1
      end do
    end if
    allocate (last(0:n), source=[0, end_of(n:1:-1)])
  end subroutine find_stages

  !> Transform the rows of fields.
  subroutine transform_fields(self, field)
    class(convolution_t), intent(inout) :: self
    !> Fields to be convolved (n_col, n_row, from)
    real(wp), intent(in), contiguous, target :: field(:, :, :)
    integer, allocatable :: last(:)
    integer :: stage, pair, n, thread

    n = (self%n_row + 1)/2
    call find_stages(self, field, last)
    thread = 1
    !$omp parallel num_threads(self%space%threads) private(stage, pair) firstprivate(thread)
    !$ thread = omp_get_thread_num() + 1
    self%row_buffer(self%extent(1) + 1:, 1, thread) = 0.0_wp
    do stage = ubound(last, 1), 1, -1
      !$omp do schedule(static)
      do pair = last(stage - 1), last(stage) - 1
        call transform_rows(self, 2*modulo(pair, n) + 1, pair/n + 1, thread, &
                            field(:, self%rows_before + 1:self%rows_before + self%n_row, pair/n + 1))
      end do
      !$omp end do
    end do
    !$omp end parallel
    if (self%ranks%size > 1) then
      call self%ranks%to_columns(layout_of(self, size(self%work, 3)), c_loc(self%work), c_loc(self%lines))
    end if
  end subroutine transform_fields

  !> Transform the columns, multiply with the spectra, and transform them back.
  subroutine multiply_columns(self, kernel)
    class(convolution_t), intent(inout) :: self
    !> Number of the kernel (onto, from), negative to reverse its sign, or `complement`
    integer, intent(in) :: kernel(:, :)
    integer :: b, thread

    thread = 1
    !$omp parallel num_threads(self%space%threads) private(b) firstprivate(thread)
    !$ thread = omp_get_thread_num() + 1
    !$omp do schedule(static)
    do b = 1, self%n_block
      call convolve_block(self, b, kernel, thread)
    end do
    !$omp end do
    !$omp end parallel
  end subroutine multiply_columns

  !> Transform the rows back.
  subroutine transform_back(self, result)
    class(convolution_t), intent(inout) :: self
    !> Sums of the convolutions (n_col, n_row, onto)
    real(wp), intent(inout), contiguous, target :: result(:, :, :)
    integer, allocatable :: last(:)
    integer :: n(2), stage, pair, o, row, thread

    n = [self%extent(1), self%n_row]
    if (self%ranks%size > 1) then
      call self%ranks%to_rows(layout_of(self, size(self%work, 3)), c_loc(self%lines), c_loc(self%work))
    end if
    call find_stages(self, result, last)
    thread = 1
    !$omp parallel num_threads(self%space%threads) private(stage, pair, o, row) firstprivate(thread)
    !$ thread = omp_get_thread_num() + 1
    do stage = 1, ubound(last, 1)
      !$omp do schedule(static)
      do pair = last(stage - 1), last(stage) - 1
        o = pair/((n(2) + 1)/2) + 1
        row = 2*modulo(pair, (n(2) + 1)/2) + 1
        ! an odd last row has no companion, but values of earlier products
        if (row == n(2)) self%work(:, row + 1, o) = 0.0_wp
        associate (joined => self%row_buffer(:, 1, thread), transformed => self%row_buffer(:, 2, thread))
          call join_rows(self%work(:self%n_frequency, row, o), self%work(:self%n_frequency, row + 1, o), joined)
          call fftw_execute_dft(self%held%plans%row, joined, transformed)
          associate (both => result(:, self%rows_before + row:self%rows_before + min(row + 1, n(2)), o))
            both(:, 1) = self%factor*real(transformed(:n(1)), wp)
            if (row < n(2)) both(:, 2) = -self%factor*aimag(transformed(:n(1)))
          end associate
        end associate
      end do
      !$omp end do
    end do
    !$omp end parallel
    if (self%space%helpers%size > 1) call gather_rows(self, result)
    if (perturb_convolution) call perturb(result)
  end subroutine transform_back

  !> Take the rows that other ranks computed.
  subroutine gather_rows(self, result)
    class(convolution_t), intent(in) :: self
    !> Sums of the convolutions, of which own rows are known (n_col, n_row, onto)
    real(wp), intent(inout), contiguous, target :: result(:, :, :)
    integer, parameter :: word = 32
    real(wp), allocatable, target :: own(:, :)
    integer :: o

    do o = 1, size(result, 3)
      own = result(:, self%rows_before + 1:self%rows_before + self%n_row, o)
      call self%ranks%fetch(self%extent(1)*(storage_size(1.0_wp)/word), self%extent(2), c_loc(own), [1, self%extent(2)], &
                            c_loc(result(1, 1, o)))
    end do
  end subroutine gather_rows

  !> Change every value by two units in the last place of the largest one; the parity of the bits of the value decides the sign.
  pure subroutine perturb(result)
    !> Sums of the convolutions (n_col, n_row, onto)
    real(wp), intent(inout) :: result(:, :, :)
    real(wp) :: change
    integer :: col, row, o

    do o = 1, size(result, 3)
      change = 2*spacing(maxval(abs(result(:, :, o))))
      if (change <= 4*tiny(change)) cycle                                      ! a result of zeros stays so
      do row = 1, size(result, 2)
        do col = 1, size(result, 1)
          if (poppar(iparity(transfer(result(col, row, o), [0_int8]))) == 0) then
            result(col, row, o) = result(col, row, o) + change
          else
            result(col, row, o) = result(col, row, o) - change
          end if
        end do
      end do
    end do
  end subroutine perturb

  !> Transform two rows of a field into those of `work`.
  subroutine transform_rows(self, row, component, thread, field)
    class(convolution_t), intent(inout) :: self
    !> Index of the first row, of the component, and of the thread, whose buffer is zero beyond the window and stays so
    integer, intent(in) :: row, component, thread
    !> Field (n_col, n_row), which may lie in the place of its transforms
    real(wp), intent(in), contiguous, target :: field(:, :)
    integer :: last

    last = min(row + 1, self%n_row)
    associate (n => self%extent(1), given => self%row_buffer(:, 1, thread), transformed => self%row_buffer(:, 2, thread))
      ! rows off the contact need no transform
      if (all(abs(field(:, row:last)) <= 0.0_wp)) then
        self%work(:, row:row + 1, component) = 0.0_wp
        return
      end if
      if (last > row) then
        call pair_rows(n, field(:, row), field(:, last), given)
      else
        given(:n) = field(:, row)
      end if
      call fftw_execute_dft(self%held%plans%row, given, transformed)
      call split_rows(transformed, self%work(:self%n_frequency, row, component), &
                      self%work(:self%n_frequency, row + 1, component))
    end associate
    ! the columns that only fill up the last block are transformed, too
    self%work(self%n_frequency + 1:, row:row + 1, component) = 0.0_wp
  end subroutine transform_rows

  !> Transform a block of columns, multiply with the spectra, transform back (the conjugate, that is).
  subroutine convolve_block(self, b, kernel, thread)
    class(convolution_t), intent(inout) :: self
    !> Index of the block
    integer, intent(in) :: b
    !> Number of the kernel (onto, from), negative to reverse its sign, or `complement`
    integer, intent(in) :: kernel(:, :)
    !> Index of the thread, whose buffer is used
    integer, intent(in) :: thread
    integer :: i, o, first, last

    first = (b - 1)*self%width + 1
    last = first + self%own_leading*(self%extent(2) - 1) + self%width - 1
    associate (given => self%block_buffer(:, :, 1, thread), transformed => self%block_buffer(:, :, 2, thread))
      do i = 1, size(kernel, 2)
        call gather_columns(self%width, self%extent(2), self%own_leading, self%padded(2), self%lines(first:last, i), given(:, i))
        call fftw_execute_dft(self%held%plans%column, given(:, i), transformed(:, i))
      end do
      if (associated(self%wide)) then
        call multiply_one(size(given, 1), real(self%wide(:, b), wp), transformed(:, 1), given(:, 1))
      else if (associated(self%narrow)) then
        call multiply(real(self%narrow(:, b, :), wp), self%first_odd, self%whole, kernel, transformed, given)
      else if (size(kernel) == 1 .and. kernel(1, 1) > 0 .and. kernel(1, 1) < self%first_odd) then
        call multiply_one(size(given, 1), self%spectrum(:, b, kernel(1, 1)), transformed(:, 1), given(:, 1))
      else
        call multiply(self%spectrum(:, b, :), self%first_odd, self%whole, kernel, transformed, given)
      end if
      do o = 1, size(kernel, 1)
        call fftw_execute_dft(self%held%plans%column, given(:, o), transformed(:, o))
        call scatter_columns(self%width, self%extent(2), self%padded(2), self%own_leading, transformed(:, o), &
                             self%lines(first:last, o))
      end do
    end associate
  end subroutine convolve_block

  !> Run the transforms of one scalar product and nothing else, to compare times with.
  subroutine time_transforms(self)
    class(convolution_t), intent(inout) :: self
    integer :: row, b, k, thread

    thread = 1
    !$omp parallel num_threads(self%space%threads) private(row, b, k) firstprivate(thread)
    !$ thread = omp_get_thread_num() + 1
    do k = 1, 2
      !$omp do schedule(static)
      do row = 1, self%n_row, 2
        call fftw_execute_dft(self%held%plans%row, self%row_buffer(:, 1, thread), self%row_buffer(:, 2, thread))
      end do
      !$omp end do
      !$omp do schedule(static)
      do b = 1, self%n_block
        call fftw_execute_dft(self%held%plans%column, self%block_buffer(:, 1, 1, thread), self%block_buffer(:, 1, 2, thread))
      end do
      !$omp end do
    end do
    !$omp end parallel
  end subroutine time_transforms

  !> Compute the address of an object.
  integer(c_intptr_t) function address(self)
    type(holdings_t), intent(in), target :: self

    address = transfer(c_loc(self), address)
  end function address

  !> Become a further user of plans, spectra and scratch.
  subroutine share(self, from)
    class(holdings_t), intent(inout) :: self
    !> Holder of the original
    type(holdings_t), intent(in) :: from
    integer :: stat

    call lock(fftw_planner)
    if (associated(from%plans)) from%plans%users = from%plans%users + 1
    call unlock(fftw_planner)
    if (associated(from%spectrum)) call from%spectrum%retain()
    if (associated(from%scratch)) call from%scratch%reserve(0_int64, stat)
    call let_go(self)
    self%place = address(self)
    self%plans => from%plans
    self%spectrum => from%spectrum
    self%scratch => from%scratch
  end subroutine share

  !> Hold nothing any more.
  impure elemental subroutine let_go(self)
    type(holdings_t), intent(inout) :: self

    if (self%place /= address(self)) return
    if (associated(self%plans)) then
      call lock(fftw_planner)
      self%plans%users = self%plans%users - 1
      if (self%plans%users == 0) then
        if (c_associated(self%plans%row)) call fftw_destroy_plan(self%plans%row)
        if (c_associated(self%plans%column)) call fftw_destroy_plan(self%plans%column)
        deallocate (self%plans)
      end if
      call unlock(fftw_planner)
      self%plans => null()
    end if
    call release(self%spectrum)
    call release_scratch(self%scratch)
  end subroutine let_go

end module hc_convolution
